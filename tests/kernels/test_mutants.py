"""The parity suite can fail: it catches every one of these deliberate mistakes."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping

import pytest

from tactograph.graph.backends import compiled_node
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.kernel_source import kernel_signatures, kernel_source
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import builtin_names, find_node
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.parity import SHAPES, cases, compare
from tactograph.nodes.height import height_solver

MUTANTS = {
    "marker_darkness": {
        "opened instead of closed": (
            "highest ? fmax(found, value)",
            "!highest ? fmax(found, value)",
        ),
        "rows twice": ("const int at = in_row ? x : y", "const int at = x"),
        "the darkest LED": ("found = fmin(found, 1.0f", "found = fmax(-found, 1.0f"),
        "black divided by": ("fmax(closed[i], darkest)", "closed[i]"),
    },
    "bare_variance": {
        "markers trusted": ("bare[i] ? film : marker", "bare[i] ? film : film"),
        "q forgotten": ("out[H * W + i] = bare[i]", "bare[i]"),
    },
    "bare_film": {
        "markers and film swapped": ("bare = 0;", "bare = 2;"),
        "not grown": ("darkness[j * W + i] > dark", "darkness[y * W + x] > dark"),
        "a threshold of its own": ("> dark)", "> 0.5f * dark)"),
    },
    "fill_masked": {
        "mask inverted": ("if (!mask[pixel])", "if (mask[pixel])"),
        "masked pixels count": ("if (!mask[j * W + i]) continue;", ""),
        "no plane": ("value = middle - p * mx - q * my", "value = middle"),
        "columns weigh alike": ("* taps[j - y + radius]", ""),
        "less than no light": ("fmin(fmax(value, 0.0f), ", "fmin(value, "),
        "no upper bound": (
            "fmin(fmax(value, 0.0f), 2.0f * fmax(middle, 0.0f))",
            "fmax(value, 0.0f)",
        ),
    },
    "print_markers": {
        "the film stays": ("u = x - drag_x_mm * near", "u = x"),
        "dragged along x alone": ("v = y - drag_y_mm * near", "v = y"),
        "no dash": ("fabs(u) - 0.5f * dash_mm", "fabs(u)"),
        "a hard edge": ("/ pixel + 0.5f", "* 1e6f + 0.5f"),
        "the drag's centre ignored": ("dx = x - center_x_mm", "dx = x"),
    },
    "flat_field": {
        "dark not subtracted": ("count) - level", "count)"),
        "floor ignored": ("MORE_OF(rest, low)", "rest"),
        "light of the first LED for all": ("image + i", "image + pixel"),
        "drift forgotten": ("if (drift)", "if (0)"),
    },
    "ball_slopes": {
        "p and q swapped": ("? -dx / z", "? -dy / z"),
        "margin ignored": ("(contact - margin_px)", "contact"),
        "sign of q": ("? -dy / z", "? dy / z"),
        "height above the centre": ("? z - sqrt(", "? z - 0.0f * sqrt("),
    },
    "height_slopes": {
        "border not one-sided": ("(float)(W - 1)) ? one : two", "(float)(W - 1)) ? two : two"),
        "not divided by the pixel": ("max(below - above, 1) / pixel", "max(below - above, 1)"),
        "mask inverted": ("<= steepest", "> steepest"),
    },
    "label_lit": {
        "LEDs counted from 1": ("1 << k", "2 << k"),
        "dark instead of lit": ("> black", "<= black"),
        "lit whatever is asked for": ("!= which", "!= 0"),
    },
    "shadow_linear": {
        "sign kept": ("fabs(departure)", "departure"),
        "brightest instead of darkest": ("value < least ?", "value >= least ?"),
        "spread forgotten": ("threshold * spread", "threshold"),
    },
    "label_lights": {
        "noise floor ignored": ("< rules->floor_ * here", "< 0.0f * here"),
        "shadows are free": ("squares + rules->price * number", "squares"),
        "a shadow may be bright": ("+ excess", "+ 0.0f * excess"),
        "a weight forgotten": ("squares += pixels->weight[k]", "squares += pixels->weight[0]"),
        "no step": ("normal = step_from(&free, start)", "normal = start"),
        "three judged at any brightness": ("count > 3 ? normal :", "count > 2 ? normal :"),
        "brightness known for certain": ("square = uneven * uneven", "square = 0.0f * uneven"),
        "certain of a doubtful brightness": ("h22 -= share", "h22 -= 0.0f * share"),
        "lights weigh alike": ("w = scaled(v, pixels->weight[k])", "w = v"),
        "the steeper of a pair": ("flatter = first.z >= second.z", "flatter = first.z < second.z"),
        "attached and prior swapped": ("if (attached)", "if (!attached)"),
        "height ignored": ("dz = led[2] - z", "dz = led[2] - 0.0f * z"),
        "lights from the corner": ("left = 0.5f * (float)(W - 1)", "left = 0.0f"),
        "all pixels in one column": ("(float)column + LANE_NUMBERS", "(float)column"),
        "a set that is closed wins": ("open & (cost < best.cost)", "cost < best.cost"),
        "variances swapped": ("put(spread.p", "put(spread.q"),
        "unknown pixels not dark": ("? here->forced : dim", "? dim : dim"),
        "shadows only where all are lit": ("ANY(best->used != all)", "!ANY(best->used != all)"),
        "no other set": ("number += kinds[l] != 0", "number += 0"),
        "all LEDs left to others": ("if (stay[l]) at[l] = -1", "if (0) at[l] = -1"),
        "the cost of all LEDs forgotten": ("cost = may ? squares : never", "cost = never"),
        "the cost of another pixel": ("cost[order[min(l, count - 1)]]", "cost[order[0]]"),
        "other pixels from the corner": (
            "(TO_FLOATS(where - row * W) - 0.5f",
            "(TO_FLOATS(where - row * W) - 0.0f",
        ),
        "other pixels a row off": ("ints row = TO_INTS(", "ints row = 2 + TO_INTS("),
        "a list without its end": ("doubtful.number - i));", "max(doubtful.number - i - 1, 1)));"),
        "sets dearer than they are": ("+ light_of(&here, out)", "+ 2.0f * light_of(&here, out)"),
        "dirt is free": ("cost = rules->dimmed;", "cost = 0.0f;"),
        "dirt brightens": ("(missing > 0.0f)", "(missing < 0.0f)"),
        "dirt although one is dark": ("rules->dimmed) & (here->forced == 0)", "rules->dimmed)"),
        "dirt although one is nearly dark": ("EVEN * brightest", "0.9f * brightest"),
        "dirt fits": ("squares_of(here, all, normal, rules->uneven)", "cost"),
    },
    "coarsen": {
        "the sum": ("total * (1.0f", "total * (factor * factor) * (1.0f"),
        "rows only": ("total += every(sums, factor, j)", "total += every(sums, factor, 0)"),
        "a column twice": ("return (float16)(a.s26ae", "return (float16)(a.s159d"),
        "the corner's neighbour": (
            "(column + l) * side]",
            "min((column + l) * side + 1, W - 1)]",
        ),
        "beyond the border": ("min(row * factor + j, H - 1)", "(row * factor + j) % H"),
        "one plane for all": ("light + k * H * W", "light"),
    },
    "enlarge_height": {
        "corners instead of centres": ("/ side - 0.5f", "/ side"),
        "rows not mixed": ("row - (float)above)", "0.0f)"),
        "the nearest column": (
            "STORE_LANES(LESS_OF(first + 1, edge), right)",
            "STORE_LANES(first, right)",
        ),
    },
    "level_light": {
        "drift of the first LED for all": ("drift + 6 * k", "drift"),
        "across the rows only": ("c[2] * v", "c[2] * u"),
        "times instead of over": ("count) / drift_gain", "count) * drift_gain"),
    },
    "film_drift": {
        "no memory": ("has_before ? before[i]", "0 ? before[i]"),
        "touched cells count too": ("calm &= fabs(", "calm &= 0.0f * fabs("),
        "skirts count too": ("most > 0.0f ? clear", "0 ? clear"),
        "no touch shows": ("untouched ? one : none", "untouched ? one : one"),
        "bounced light is drift": ("- load_floats(bounced + i, count)", ""),
    },
    "touch_misfit": {
        "level film tells too": ("q * q > TILTED * TILTED", "q * q > 0.0f"),
        "any LEDs tell": ("== (1 << K) - 1)", "!= 999)"),
        "the neighbour below alone": ("+ LOAD_LANES(here + lag))", "+ 0.0f)"),
        "the nearest neighbours": ("here + lag * W) + LOAD_LANES(here + lag)", "here + W) * 2.0f"),
        "the LEDs' sum": (" / (float)K", ""),
        "as many as blocks": ("pairs += LOAD_LANES(counts + i) *", "pairs += 0.1f *"),
        "the width forgotten": ("misfit[1] = width", "misfit[1] = level"),
        "brightness known": ("departs - brighter * shown", "departs"),
    },
    "matt_light": {
        "bounced light forgotten": ("if (bounced) shown[k] -=", "if (0) shown[k] -="),
        "no grain": ("grain = film_grain * shown[k]", "grain = 0.0f * shown[k]"),
        "noise of the whole light": (" * scale[k], sigma_", ", sigma_"),
        "shadows not black": ("shown[k] * scale[k] - share", "shown[k] * scale[k]"),
        "always matt": (
            "affine = film_refraction == 1.0f",
            "affine = 1 || film_refraction == 1.0f",
        ),
        "height as seen": ("seen / (1.0f + film_camera * seen)", "seen"),
        "beside the ray": ("{u * nearer, v * nearer, z, u, v}", "{u, v, z, u, v}"),
        "the slope's sign": ("unit(-p, -q,", "unit(p, q,"),
        "no steps": ("step < turns", "step < 0 * turns"),
        "harmonics do not bend": ("2.0f * bent.x - shade[0]", "0.0f * bent.x"),
        "half of a product": ("b < 6 ? 0.5f", "b < 6 ? 0.25f"),
        "nothing fades": ("fades ? PER_FADE", "fades ? 0.0f * PER_FADE"),
        "the first stretch alone": ("first = STRETCH * (", "first = 0 * ("),
        "the row above": ("((float)row - 0.5f", "((float)(row - 1) - 0.5f"),
        "light from behind": ("MORE_OF(matt, none)", "matt"),
        "touched film no brighter": ("* LESS_OF(MORE_OF(lifted, none), one)", "* 0.0f"),
        "the first LED's share": ("1.0f - film->diffuse[k]", "1.0f - film->diffuse[0]"),
        "the first LED's harmonics": ("(k * SHADES + b) * TERMS", "b * TERMS"),
        "a harmonic's sign": ("fma(-shade[6], n.y", "fma(shade[6], n.y"),
        "a term of the place": ("fma(c[4], v, c[1])", "c[1]"),
        "harmonics never end": ("LESS_OF(MORE_OF(beyond, none), one)", "one"),
        "as bright as at rest": ("share = direct / light", "share = direct"),
        "no lobe": ("base + spread * masking", "base + 0.0f * spread * masking"),
        "as smooth as glass": ("wide = roughness * roughness", "wide = roughness"),
        "a smooth coat's share": ("t = roughness *", "t = 1e-3f *"),
        "polarised": ("(1.0f + other * other)", "(1.0f - other * other)"),
        "the base under no coat": ("* (1.0f / PI_)", "* 1.0f"),
        "steps off-diagonal": ("(c * g - b * h)", "(c * g + b * h)"),
        "lights weigh alike": ("/ (whole * whole)", ""),
        "no longest step": ("MORE_OF(length, longest)", "longest"),
        "a coat as no coat": ("film_refraction == 1.0f && film_camera == 0.0f && film_d", "film_d"),
        "shadows tell of the normal": ("LESS_OF(MORE_OF(share, none), one)", "one"),
        "the way back": ("to_unit /= share", "to_unit *= share"),
    },
    "view_slope": {
        "never inverse": ("inverse ?", "0 * inverse ?"),
        "the height alone": ("p * u + q * v", "0.0f * (p * u + q * v)"),
        "p and q swapped": ("p * u + q * v", "q * u + p * v"),
        "the film's height": ("seen / (1.0f + camera * seen)", "seen"),
        "of the place as seen": ("along * nearer", "along"),
        "q as it was": ("q *= by;", ""),
    },
    "level_height": {
        "surface of another degree": ("v * (cv + v", "v * (cv - v"),
        "heights of other cells": ("row = min(y * cell + cell / 2", "row = min(y * cell / 2"),
    },
    "undo_perspective": {
        "the other way": ("1.0f + camera * seen", "1.0f - camera * seen"),
        "not at all": ("seen / (1.0f + camera * seen)", "seen"),
    },
    "film_bounce": {
        "hidden film seen": ("seen ? up / aside : on->horizon", "up / aside"),
        "no tangent to begin with": (
            "horizon = -across / facing;",
            "horizon = -9.0f + 0.0f * across;",
        ),
        "the horizon never rises": ("on->below = higher", "on->below = on->below"),
        "half of the azimuths": ("number < AZIMUTHS", "number < AZIMUTHS / 2"),
        "between no cells": ("one + part * (other - one)", "one"),
        "no rim": ("cells->film + 0.5f", "0.5f"),
        "the rim without an end": ("steps = LESS_OF(on->longest, far)", "steps = far"),
        "light of the cell that is last": ("0.5f * (float)(last + step)", "(float)step"),
        "as if lit evenly": ("= rest * lit", "= lit"),
        "not relative to the film at rest": ("total[k] / rest", "total[k]"),
        "p for q": ("(height, across, down, H, W, 0)", "(height, across, down, H, W, 1)"),
        "cells unsmoothed": ("upper, right) - a) * across", "upper, right) - a) * 0.0f"),
        "no memory": ("share * (found - earlier)", "(found - earlier)"),
        "a coat as none": ("on->let_out * let_in_at(on->film, cosine)", "on->let_out"),
        "the base sends alike": ("k * N) * from->let_out", "k * N)"),
        "the camera's mirror kept": ("seen - falls *", "seen - 0.0f * falls *"),
        "no mirror on the way out": (
            "lobe = facets(film, along, 2.0f - 2.0f",
            "lobe = 0.0f * facets(film, along, 2.0f - 2.0f",
        ),
        "no mirror on the way in": (
            "lobe = facets(on->film,",
            "lobe = 0.0f * facets(on->film,",
        ),
        "a lobe of the middle alone": ("+ 2.0f / 3.0f * reach", ""),
        "mirrored from behind": (
            "facing > none ? unhidden(film, facing) : none",
            "unhidden(film, facing)",
        ),
        "all lit by the first LED": ("(SOURCE_LED + 3 * k) * N;", "SOURCE_LED * N;"),
    },
    "view": {
        "the camera too close": ("1.0f - z / s.camera_mm", "1.0f - 2.0f * z / s.camera_mm"),
        "the lens forgotten": ("1.0f + lens_at_corner *", "1.0f + 0.0f *"),
        "corner at the side": ("half_w * half_w + half_h * half_h", "half_w * half_w"),
        "seen through walls": ("                break;\n", ""),
        "steps only": ("#define HALVINGS 24", "#define HALVINGS 0"),
        "p for q": ("bilinear(slope + size, b, W)", "bilinear(slope, b, W)"),
        "labels cut off": ("floor(at.x + 0.5f)", "floor(at.x)"),
    },
    "blur": {
        "the border is dark": ("clamp(x + i, 0, W - 1)", "x"),
        "weights the wrong way": ("weights[i + radius]", "weights[0]"),
    },
    "diffuse_gel": {
        "all of the light stays": ("(1.0f - share) * direct", "direct"),
    },
    "interreflect": {
        "light not relative": ("/ MORE_OF(level, least)", ""),
        "one bounce": ("bounced[k * h * w + i]", "0.0f * bounced[k * h * w + i]"),
        "as if lit evenly": ("direct[(CELL_REST + k) * N + cell]", "1.0f"),
        "added as it is": ("load_floats(rest + i, count) * added", "added"),
        "no mirror between places": (
            "lobe = facets(film, along, 2.0f - 2.0f",
            "lobe = 0.0f * facets(film, along, 2.0f - 2.0f",
        ),
    },
    "light_noise": {
        "shot noise forgotten": ("noise[0] * MORE_OF(light, none) + noise[1]", "noise[1]"),
        "variance instead": ("sqrt(variance)", "variance"),
        "of the image as captured": ("/ MORE_OF(rest, low)", ""),
        "integers no fractions": ("_OF_FLOATS(value) over_full(value)", "_OF_FLOATS(value) value"),
    },
    "lut_nearest": {
        "boxes too small to reach": (
            "const floats away = point[k] - there;",
            "const floats away = 1.5f * (point[k] - there) + 0.01f;",
        ),
        "the first leaf only": (
            "const int l = take(&near), leaf = 16 * middle + l;",
            "const int l = take(&near), leaf = packet->first;",
        ),
        "one leaf off": ("leaf = 16 * middle + l;", "leaf = 16 * middle + (l ^ 1);"),
        "the full table for all": ("table = k + 1;", "table = 0;"),
        "the brightest shadowed LED": ("value < least)", "value > -least)"),
        "pixels out of order": ("from + order[i]", "from + i"),
        "lit cells alone": ("t = table_of_cell(cell, levels);", "t = 0;"),
        "pixels put back in order": ("found_slopes[2 * place[pixel]]", "found_slopes[2 * pixel]"),
        "one neighbour too few": (
            "if (place == NEIGHBOURS) {",
            "if (place == max(NEIGHBOURS - 1, 1)) {",
        ),
        "a repeated entry counts twice": ("if (several->number[i] == number) return;", ";"),
    },
    "refine_taylor": {
        "shadowed pixels too": ("p = lit ? p + dp * shrink : p", "p = p + dp * shrink"),
        "limit ignored": ("limit * square", "1e9f * square"),
        "one harmonic's sign": ("l[7] * (x * x - y * y)", "l[7] * (x * x + y * y)"),
        "off-diagonal sign": ("(c * u - b * v)", "(c * u + b * v)"),
    },
    "smooth_light": {
        "rows only": ("load_within_border(row, x + i - REACH", "load_within_border(row, x"),
        "shifted": ("within_border(top + j - REACH", "within_border(top + j - 1"),
        "the first row's for all": ("along[y + j]", "along[j]"),
        "one plane for all": ("light + k * H * W", "light"),
    },
    "solve_reflectance_map": {
        "height ignored": ("* load_floats(height", "* 0.0f * load_floats(height"),
        "place ignored": ("sum = sum * u + polynomial[power]", "sum = polynomial[power]"),
        "lights weigh alike": ("= load_floats(flat + k * size + at, count)", "= 1.0f"),
        "no prior": (
            "floats a = prior, b = none, c = prior",
            "floats a = none, b = none, c = none",
        ),
        "limit ignored": ("limit * square", "1e9f * square"),
        "off-diagonal sign": ("(c * s - b * t)", "(c * s + b * t)"),
        "u and v swapped": (
            "degree * (degree + 1) / 2 + degree - power",
            "degree * (degree + 1) / 2 + power",
        ),
        "one row for all": ("+ row * K * SHADES * POWERS", ""),
        "still too soon": ("least = still * square", "least = 100.0f * still * square"),
    },
    "integrate_dct": {
        "half of the divergence": ("- LOAD_LANES(p + x - 1)", ""),
        "not in mm": ("scale * load_floats", "load_floats"),
        "open border": ("p[column + 1] : -p[column]", "p[column + 1] : p[column]"),
        "rows out of order": ("y & 1 ? N - 1 - y / 2 : y / 2", "y"),
        "a pair of columns mixed": ("- w.y * (m[0] - z[0])", "+ w.y * (m[0] - z[0])"),
        "a mean": ("-= mean", "-= 0.0f * mean"),
        "a stage left out": ("while (done < N)", "while (done < N / 2)"),
    },
    "integrate_frankot_chellappa": {
        "u and v swapped": ("(u * p + v * q) * scale", "(v * p + u * q) * scale"),
        "conjugate": ("(float2)(sum.y, -sum.x)", "(float2)(-sum.y, sum.x)"),
        "mirrored sign": ("out[y * W + x] = -(u", "out[y * W + x] = (u"),
    },
    "rest_at_border": {
        "upper median": ("(N - 1) / 2", "N / 2"),
        "added": ("- median[0]", "+ median[0]"),
        "top rows only": ("return (H - border) * W + j", "return j"),
    },
    "height_system": {
        "a step twice": ("floats step_ = 0.5f *", "floats step_ = 1.0f *"),
        "no cubic part": ("? LESS_OF(up, limit) : none", "? none : none"),
        "turns cost nothing": ("turned * turned", "0.0f * turned"),
        "unknown slopes as good": ("+ LONELY", "+ 0.0f"),
        "the mask ignored": ("counts != 0 ? variances[n]", "counts != 99 ? variances[n]"),
        "film at rest is free": ("!= 0 ? still : free_", "!= 0 ? free_ : free_"),
        "what does not count rests": ("? found : out", "? found : still"),
        "a step beyond the last column": ("beside ? wanted * pixel", "1 ? wanted * pixel"),
        "a step beyond the last row": ("below ? spread * pixel", "1 ? spread * pixel"),
        "a window around the film at rest": ("rest[i] ? 2 : 1", "rest[i] ? 1 : 2"),
        "the frame's corner": ("(top + y) * frame_width + left;", "y * frame_width;"),
    },
    "integrate_weighted": {
        "film at rest not held": ("filled(count) ? stiff : none", "filled(count) ? none : none"),
        "outliers not given up": ("residual * residual / square", "0.0f * square"),
        "rises forgotten": ("knot_stiffness[e] * want_rise[(", "0.0f * want_rise[("),
        "a tie without a foot": (
            "? -stretch : stretch;",
            "? 0.0f : stretch;",
        ),
        "what is left out has a height": ("state[y * W + x] != AWAY", "state[y * W + x] != 99"),
        "a border above zero": ("z[y * W + x] - by", "z[y * W + x] - 0.0f * by"),
        "the height before ignored": (
            "times(costs, cost_between(z, want_right",
            "times(costs, 1.0f + 0.0f * cost_between(z, want_right",
        ),
        "what the last direction moves forgotten": (
            "pulled += share * LOAD_LANES(moved + i)",
            "pulled += 0.0f * LOAD_LANES(moved + i)",
        ),
        "no step but the first cycle": ("gain[STEPS] += 1.0f", "gain[STEPS] += 0.0f"),
        "steps that do not end": ("energy > enough && energy > 0.0f ?", "energy >= 0.0f ?"),
        "window off by one": ("z[y * W + x] - by", "z[y * W + max(x - 1, 0)] - by"),
        "rows of another length": ("z + first + row * S + x", "z + first + row * W + x"),
        "springs beyond the frame": ("return filled(count) ? found : none;", "return found;"),
        "ties not marked": ("if (mark & TIED)", "if (0)"),
        "film at rest not marked": ("ANY(held != 0.0f) ? HELD : 0", "0"),
        "the energy's sign": ("total += LOAD_LANES(force + i)", "total -= LOAD_LANES(force + i)"),
        "the coarsest level ignored": (
            "total += LOAD_LANES(dense",
            "total += 0.0f * LOAD_LANES(dense",
        ),
        "coarse springs half as stiff": (
            "east += PAIR_ENDS(",
            "east += 0.0f * PAIR_ENDS(",
        ),
    },
    "shadow_constraints": {
        "away from the LED": ("row + uy * t;", "row - uy * t;"),
        "the light's share forgotten": ("/ MORE_OF(expected, faintest)", ""),
        "the shadow's end at half a pixel": (
            "end = clamp(t - back",
            "end = HALF + 0.0f * (t - back",
        ),
        "slopes not known": ("popcount(used[i]) < 2", "popcount(used[i]) < 1"),
        "the edge not known": ("popcount(used[edge]) < 2", "popcount(used[edge]) < 1"),
        "the slope at the end ignored": ("* tangent + to_end", "* tangent"),
        "a distant LED": ("- (height[i] + to_end)", "- 0.0f * height[i]"),
        "LEDs counted from 0": ("line / H + 1", "line / H"),
        "shadows of the first LED alone": ("near >> k & 1 ? count", "near & 1 ? count"),
        "measurements of a span alike": ("rise_of[from + c]", "rise_of[from]"),
        "spans that begin where they end": ("ends[n] - count", "ends[n]"),
        "no longest shadow": ("t <= longest", "t <= 1e9f"),
    },
    "height_error": {
        "all draws alike": ("x >> 31 ?", "x >> 0 ?"),
        "waves in step": ("+ kind[n].phase", "+ kind[0].phase"),
        "pairs of errors alike": ("3 * (n * K + k)", "3 * (n / 2 * K + k)"),
        "noise of p and q apart": ("along * first + across * second", "across * second"),
        "one draw for p and q": ("drawn_from(H * W + i,", "drawn_from(i,"),
        "the flat frame without noise": ("1.0f + flat * flat", "1.0f"),
        "pixels with noise of their own": ("shared * noise[k]", "noise[k]"),
        "no common error": ("(other[0] - led[0]) * by.x", "0.0f * by.x"),
        "LEDs no higher": ("(other[2] - led[2]) * by.z", "0.0f * by.z"),
        "an exact model": ("1.4142136f * misfit[0]", "0.0f * misfit[0]"),
        "a model as wrong on film at rest": ("* tilted * cosine_of", "* cosine_of"),
        "an exact bounce": ("kind[n].sign * wrong * thrown", "0.0f"),
        "edges resolved": ("+ edge * edge", ""),
        "tilts that are right": ("kind[n].leaning * (", "0.0f * ("),
        "a bounce that has settled": ("kind[n].settling * changed", "0.0f"),
        "all LEDs used": ("lit = (used & (1 << k)) != 0", "lit = (used & (1 << k)) != 999"),
        "brightness known for certain": ("square = uneven * uneven", "square = 0.0f * uneven"),
        "kinks squared": ("bend * bend * bend", "bend * bend"),
        "kinks downhill": (
            "down = -1.0f;\n    const floats falls",
            "down = 1.0f;\n    const floats falls",
        ),
        "steps at the border as inside": ("column == 0.0f | column", "column < 0.0f | column"),
        "rises without error": ("error * drawn(t, key)", "0.0f * drawn(t, key)"),
        "cells half as stiff": ("one + (below ?", "one + 0.0f * (below ?"),
        "the first row's steps alone": (
            "(1.0f - share) * steps_of_row",
            "0.0f * steps_of_row",
        ),
        "the first error of a launch": ("2 * number * H * W", "0 * number"),
        "steps of cells without their ends": (
            "+ 0.5f * PAIR_STARTS(low_",
            "+ 0.0f * PAIR_STARTS(low_",
        ),
        "rises of cells forgotten": ("+ t] = pulled", "+ t] = 0.0f * pulled"),
        "cells as blocks": ("0.75f * between_rows", "0.5f * between_rows"),
        "the last load alone": ("sum += shares[load_]", "sum = shares[load_]"),
        "one height for all loads": ("(load_) * apart", "0 * apart"),
        "all loads want the same": ("(number * H + line) * W", "(number * H + row) * W"),
        "rises of the first load": ("(number + load_) * ties", "0 * ties"),
        "cells of the first load": ("(number * h + y) * w", "y * w"),
        "border repeated": ("i < 0 ? -i :", "i < 0 ? -i - 1 :"),
        "the film at rest too": (
            "load_floats(freed + i, count) > 0.0f",
            "load_floats(freed + i, count) >= 0.0f",
        ),
        "not a mean": ("/ MORE_OF(total, least)", "+ 0.0f * MORE_OF(total, least)"),
    },
    "calm_film": {
        "the window forgotten": ("fabs(sum) / width", "fabs(sum)"),
        "noise of the first LED": ("sigma + k * size + i", "sigma + i"),
        "the last LED alone": ("level * noise ? calm", "level * noise ? one"),
    },
    "majority_labels": {
        "four votes": ("= 0x33333333", "= 0x44444444"),
        "seven LEDs": ("& 0xff;", "& 0x7f;"),
    },
    "misfit_variance": {
        "less variance for less misfit": ("fmax(misfit[i] / usual, 1.0f)", "misfit[i] / usual"),
        "all pairs open": ("open_pairs &&", ""),
        "the whole difference": ("0.25f * apart_q", "apart_q"),
        "a steep twin": ("clamp(twin_p, -steepest, steepest)", "twin_p"),
    },
    "cliff_variance": {
        "towards the LED": ("(float)x - dx / plan", "(float)x + dx / plan"),
        "shadowed pixels too": ("if (shadow[i] >> k & 1) continue;", ""),
        "not squared": ("count) + step * step, out + i", "count) + step, out + i"),
        "grazing light too": ("jump * (largest - grazing)", "jump * largest"),
        "one row only": ("cliffs + clamp(y + dy, 0, H - 1) * W", "cliffs + y * W"),
        "no margin": ("shadow + clamp(y + dy, 0, H - 1) * W", "shadow + y * W"),
    },
    "pixel_mean_slope": {
        "one axis": (" + along.z * (along.x + p * along.z)", ""),
        "limit ignored": ("most * square", "1e9f * square"),
        "border not one-sided": ("x > 0 && x + 1 < W ? 0.5f : 1.0f", "0.5f"),
        "top not one-sided": ("row > 0 && row + 1 < H ? 0.5f : 1.0f", "0.5f"),
        "a row too far": ("at + W : at;", "at + W + 1 : at;"),
    },
    "settle_loose": {
        "all pixels": ("> loose;", "> -1.0f;"),
        "one line": ("LESS_OF(low, low_too)", "a"),
        "peaks only": ("+ LESS_OF(highest, none)", ""),
    },
    "undistort": {
        "no lens": ("bent = is_bent(lens)", "bent = 0"),
        "the quartic term forgotten": ("k1 + k2 * square", "k1"),
        "the centre forgotten": ("du = u + qu - cx", "du = u + qu"),
        "tilt as shear": ("a * u + b * v - w * u", "a * u - b * v - w * u"),
        "no perspective of the tilt": ("gx * u + gy * v, nearer", "0.0f * u, nearer"),
        "linear": ("0.5f * (ttt - tt)", "0.0f * ttt"),
        "a column off, whole rows": ("(int)low_shift - 1", "(int)low_shift"),
        "a column off at the border": ("left[l] + i - 1", "left[l] + i"),
        "all lanes as the first": (
            "shift - low_shift, taps->columns",
            "0.0f * shift, taps->columns",
        ),
        "one plane for all": ("image + k * H * W", "image"),
        "integers no fractions": (
            "return fma(fma(-near, full, whole), part, near);",
            "return whole;",
        ),
    },
    "as_seen": {
        "one step of Newton's": ("#define STEPS 4", "#define STEPS 1"),
        "the quartic term forgotten": ("two * ff * ff + 1.0f) - 1.0f", "1.0f) - 1.0f"),
        "as undistorted": (
            "ideal_places(lens, row, column, H, W, &u, &v);",
            "seen_places(lens, row, column, H, W, &u, &v);",
        ),
        "tilt not taken back": ("m00 = a - qx * gx + 1.0f", "m00 = 1.0f"),
        "no lens": ("if (is_bent(lens))", "if (0)"),
    },
    "doubt_rest": {
        "all film at rest": ("!= 0 ? held", ">= 0 ? held"),
        "slopes alone forgotten": ("sqrt(z * z + hidden)", "sqrt(hidden)"),
        "nothing hidden": ("widest / 6.0f", "widest * 0.0f"),
        "one slope": ("load_floats(variance + size + at", "0.0f * load_floats(variance + at"),
        "slopes without a limit": ("LESS_OF(both, most)", "both"),
        "zero known": (" + zero * zero", ""),
    },
    "error_as_seen": {
        "the pixel to the left alone": ("east = LESS_OF(west + 1, last_column)", "east = west"),
        "the row above alone": ("south = LESS_OF(north + 1, last_row)", "south = north"),
        "shares swapped": ("down * lower", "(1.0f - down) * lower"),
        "not between columns": ("across = u - floor(u)", "across = 0.0f * u"),
        "no lens": ("!is_bent(lens)", "1"),
    },
    "labels_as_seen": {
        "the pixel to the left": ("right) + 0.5f", "right)"),
        "the frame's row": ("down * W + across", "row * W + across"),
        "no lens": ("!is_bent(lens)", "1"),
    },
    "confidence_as_seen": {
        "the pixel above": ("bottom) + 0.5f", "bottom)"),
        "not clamped": ("LESS_OF(MORE_OF(u, none), right)", "MORE_OF(u, none)"),
        "no lens": ("!is_bent(lens)", "1"),
    },
    "label_highlights": {
        "the first LED left out": ("fit(&seen, K, k)", "fit(&seen, K, 0)"),
        "darker too": ("bright & facing", "facing"),
        "facing anything": ("bright & facing", "bright"),
        "others that disagree": ("& (others.misfit < likely)", ""),
        "all pixels doubted": ("marked = doubted ? marked : none;", ""),
        "noise of the prediction forgotten": ("noise * noise + doubt", "noise * noise"),
        "level film explains more": (
            "doubted = level > unlikely",
            "doubted = level > 1e3f * unlikely",
        ),
        "of any length": ("over = (length_ - 1.0f)", "over = 0.0f * (length_ - 1.0f)"),
        "the film level": (
            "light_vector(lights + 3 * k, x, y, z)",
            "light_vector(lights + 3 * k, x, y, 0.0f)",
        ),
    },
    "cast_shadows": {
        "away from the LED": ("x + ux * t", "x - ux * t"),
        "LEDs counted from 1": ("labels |= 1 << k", "labels |= 2 << k"),
        "the image not asked": ("near ? near[", "0 ? near["),
        "shadows of the first LED alone": ("asked >> k & 1", "asked & 1"),
        "the reach forgotten": ("d = -reach;", "d = 0;"),
        "blocks all as low as the first pixel": (
            "found = fmax(found, height[y * W + x])",
            "found = height[0]",
        ),
    },
    "shadow_confidence": {
        "the labels swapped": ("? -lit : lit", "? lit : -lit"),
        "edges near by only": ("count, H, W, 2)", "count, H, W, 1)"),
        "the image not asked": ("label ^ load_bytes(seen + i, count)", "label ^ label"),
        "noise forgotten": ("square / (square + doubt * doubt)", "1.0f"),
        "the last LED alone": ("sure_of_all *= 1.0f", "sure_of_all = 1.0f"),
        "lights from the corner": ("0.5f * (float)(W - 1)", "0.0f"),
    },
    "gaussian_blur": {
        "a tap left out": ("int i = -radius; i", "int i = 1 - radius; i"),
        "columns along rows": (
            "plane + within_border(y + i, H, border) * W",
            "plane + within_border(y + i, H, border)",
        ),
        "the border always repeated": ("border == REPLICATE || n == 1", "1"),
        "the last pixel twice, or not": ("border == REFLECT;", "border != REFLECT;"),
        "one plane for all": ("light + k * H * W", "light"),
    },
    "median_blur": {
        "always 3 x 3": ("size ? middle_of(window, 25) :", "0 ? middle_of(window, 25) :"),
        "the value below the middle": (
            "return window[count / 2];",
            "return window[count / 2 - 1];",
        ),
        "rows mixed up": ("within_border(y + j, H, REPLICATE) * W", "y * W"),
    },
    "threshold": {
        "as bright counts": ("> level", ">= level"),
        "any for all": ("brighter == K", "brighter > 0"),
        "all for any": ("lights ? brighter > 0", "lights ? brighter == K"),
    },
    "mask_image": {
        "mask inverted": ("mask[y * W + x] ?", "!mask[y * W + x] ?"),
        "black outside": (": outside", ": 0.0f * outside"),
    },
    "blend_images": {
        "weights swapped": (
            "first[i] * (1.0f - share) + second[i] * share",
            "first[i] * share + second[i] * (1.0f - share)",
        ),
        "a sum": ("first[i] * (1.0f - share)", "first[i]"),
    },
    "morphology": {
        "always the whole square": ("if (!element[", "if (0 && element["),
        "beyond the frame is 0": ("found = highest ? 0 : 255", "found = 0"),
        "turned over": ("highest ? max(found, value) :", "!highest ? max(found, value) :"),
        "a column short": ("min(x + radius, W - 1)", "min(x + radius - 1, W - 1)"),
    },
    "bilateral_blur": {
        "edges do not count": ("of_light * step * step", "0.0f * of_light"),
        "places do not count": ("of_place * (float)square", "0.0f * of_place"),
        "a square": ("if (square > radius * radius) continue;", ""),
        "the border always repeated": ("border == REPLICATE || n == 1", "1"),
    },
    "rectify": {
        "from the corner": ("- 0.5f * (float)(W - 1)", ""),
        "x and y swapped": ("find_taps(x, y,", "find_taps(y, x,"),
        "one plane for all": ("value_at(light + plane,", "value_at(light,"),
        "the nearest pixel": ("spread_weights(x - left,", "spread_weights(none,"),
    },
    "crop": {
        "from the left border": ("* W + left + x]", "* W + x]"),
        "from the upper border": ("* H + top + y)", "* H + y)"),
        "one plane for all": ("(k * H + top", "(top"),
    },
    "light_departure": {
        "height ignored": ("z = load_floats(height", "z = 0.0f * load_floats(height"),
        "noise forgotten": ("noise * noise + model * model", "model * model"),
        "noise of a pixel": ("* share_of_noise", ""),
        "dark light is exact": ("error * MORE_OF(shown, darkest)", "error * shown"),
        "the calibration's misfit forgotten": ("max(misfit[2], LEAST_ERROR)", "LEAST_ERROR"),
        "unevenness forgotten": ("UNEVEN_SHARE * uneven", "0.0f * uneven"),
        "LEDs that were not used": ("lit = ((bits >> k) & 1) != 0 ?", "lit = 1 ?"),
        "brightness known": ("departs[k] - product * share * along[k]", "departs[k]"),
        "brightness costs nothing": ("- share * whole", ""),
        "the slope costs nothing": ("leds - 2.0f", "leds"),
        "pairs are tested": ("freedom >= smallest ?", "leds >= none ?"),
        "the slope's sign": ("v.z - v.x * p", "v.z + v.x * p"),
    },
    "map_departure": {
        "height ignored": ("c[SHADES - 1] * height[at]", "0.0f * height[at]"),
        "one map for all": ("(k * SHADES + b) * TERMS", "b * TERMS"),
        "u and v swapped": ("* TERMS, u, v)", "* TERMS, v, u)"),
        "the film at rest is black": ("- 1.0f - shown", "- shown"),
        "the slope costs nothing": ("(float)(K - 2)", "(float)K"),
        "another misfit": ("max(misfit[2], LEAST_MAP_ERROR)", "max(misfit[0], LEAST_MAP_ERROR)"),
        "not relative to the film at rest": ("c[2] * (z - 1.0f)", "c[2] * z"),
        "the slope's sign": ("x = -p * z", "x = p * z"),
    },
    "slope_curl": {
        "a divergence": ("curl = p_down - q_right", "curl = p_right + q_down"),
        "curvature forgotten": ("share * share * bent", "0.0f * bent"),
        "the calibration's misfit forgotten": ("+ misfit[0] * misfit[0]", ""),
        "noise of a pixel": ("* 0.25f / pixels", "* 0.25f"),
        "noise taken once": ("NOISE_WEIGHT * noise", "noise"),
        "noise of a coarse pixel": ("(float)(side * cell_px)", "(float)side"),
        "variance of p alone": ("mean_of_cell(variance + size, y, x, H, W, side)", "0.0f"),
        "pairs are tested": ("fewest >= MIN_LEDS", "fewest >= 0"),
        "level film is tested": ("gentlest > MIN_SLOPE * MIN_SLOPE", "gentlest >= 0.0f"),
        "edges are tested": ("bent < MAX_CURVATURE * MAX_CURVATURE", "bent < INFINITY"),
        "beyond the border": ("row == h - 1 || column == w - 1", "row == h || column == w"),
        "LEDs of another pixel": ("used[y * side * W + x * side]", "used[y * W + x]"),
        "the sum of a cell": (" * (1.0f / (float)(side * side))", ""),
        "one row of a cell": ("i < side; ++i)\n            sum", "i < 1; ++i)\n            sum"),
    },
    "resize_image": {
        "the first row alone": ("from[j * W + i]", "from[i]"),
        "the first column alone": ("from[j * W + i]", "from[j * W]"),
        "a row short": ("j < down;", "j < max(down - 1, 1);"),
        "all rows count alike": ("row_shares[y * down + j]", "row_shares[j]"),
        "all columns count alike": ("column_shares[x * across + i]", "column_shares[i]"),
        "one plane for all": ("(k * H + first_row[y])", "(first_row[y])"),
    },
}
LISTED = [(name, what) for name, mutants in MUTANTS.items() for what in mutants]


KERNEL = re.compile(r"^[^\n]*\b__kernel\b.*?^}", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(("name", "what"), LISTED, ids=[f"{n}: {w}" for n, w in LISTED])
def test_parity_catches(name: str, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = MUTANTS[name][what]
    build = compiled_node._build

    def build_mutant(node: Node, queue: Queue, constants: Mapping[str, int]) -> dict[str, Kernel]:
        source = kernel_source(node)
        assert before in source, "the mutant no longer fits the kernel"
        mutant = source.replace(before, after)
        right = build(node, queue, constants)
        with monkeypatch.context() as patch:
            patch.setattr(compiled_node, "kernel_source", lambda _: mutant)
            wrong = build(node, queue, constants)
        changed = wrong_kernels(source, mutant)
        return {name: (wrong if name in changed else right)[name] for name in right}

    monkeypatch.setattr(compiled_node, "_build", build_mutant)
    # Small frames have levels of one work-group alone, but for this.
    monkeypatch.setattr(height_solver, "ONE_GROUP_OF_LANES", 1024)
    assert any(differences(find_node(name)))


def wrong_kernels(source: str, mutant: str) -> set[str]:
    """The kernels that a mistake is in: all of them if it is outside of kernels.

    The others need not be compiled again for each mutant of a node of forty kernels.
    """
    texts = [
        dict(zip(kernel_signatures(s), KERNEL.findall(s), strict=True)) for s in (source, mutant)
    ]
    if KERNEL.sub("", source) != KERNEL.sub("", mutant):
        return {*texts[1]}
    return {name for name, text in texts[1].items() if text != texts[0][name]}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_kernel_is_no_mutant_of_itself(name: str) -> None:
    """Compiled as the mutants are, it agrees."""
    assert not any(itertools.islice(differences(find_node(name)), 3))


def differences(node: Node) -> Iterator[str | None]:
    """What parity says of a node, case by case: first what most mutants fail on.

    Without optimisation, which takes half of the compiler's time and hides no mistake.
    """
    found, _ = choose_device()
    assert found is not None
    device = OpenCL(found)
    device.options.append("-cl-opt-disable")
    for case in sorted(cases(node), key=lambda case: abs(case.sizes.get("H", 0) - SHAPES[2][0])):
        yield compare(node, device, case)


def test_every_kernel_of_the_flow_has_mutants() -> None:
    kernels = {name for name in builtin_names() if find_node(name).has_kernel}
    assert kernels - set(MUTANTS) <= {"render", "press"}, "tested against analytic scenes instead"
