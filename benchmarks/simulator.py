"""Print, as Markdown, how far `simulate_hand` is from the ray tracer's rigs in the hand.

    python benchmarks/simulator.py [--data ../shared/data/raytraced] [--rigs hand hand_bounce]

Each rig's properties are those of its scene.json; the shapes are the true heights of
`hand_ideal`, which are seen from straight above.  One gain per rig is fitted on its flat frame.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import load

ROOT = Path(__file__).resolve().parent.parent
RIGS = ("ideal", "perspective", "lens", "discs", "gloss", "bounce")
SCENES = ("calibration", "calibration_off", "sphere_film", "corner_film", "teapot_film", "cat_film")
GRAPH = """
format: 1
extends: simulate_hand
patch:
  - replace: shape
    op: shape_image
    with: {{file: {file}, pixel_size_mm: $pixel_size_mm}}
  - neutral: film
  - set: scene
    with: {{level: 1.0, cosine_leds: {disks}}}
  - set: rest
    with: {{level: 1.0, cosine_leds: {disks}}}
outputs: {{light: lens, height: view.height, labels: view.labels}}
"""
F4 = NDArray[np.float32]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared/data/raytraced")
    parser.add_argument("--rigs", nargs="+", default=[*(f"hand_{rig}" for rig in RIGS), "hand"])
    options = parser.parse_args()
    print("| rig | flat frame | touched film, mean | median | bias | 99 % below |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for rig in options.rigs:
        print(row(options.data, rig), flush=True)


def row(data: Path, rig: str) -> str:
    """The differences in grey levels of 255, over all scenes."""
    facts = json.loads((data / rig / "flat/scene.json").read_text())
    flat = images(data / rig / "flat")
    rest = rendered(data / "hand_ideal/flat/truth_height_mm.npy", facts)["light"]
    gain = float((flat * rest).sum() / (rest * rest).sum())
    noise = np.abs(gain * rest - flat)
    found = [differences(data, rig, scene, facts, gain) for scene in SCENES]
    wrong = np.concatenate(found)
    size = np.abs(wrong)
    figures = size.mean(), np.median(size), wrong.mean(), np.percentile(size, 99)
    cells = " | ".join(f"{value:.2f}" for value in figures)
    return f"| `{rig}` | {noise.mean():.2f} | {cells} |"


def differences(data: Path, rig: str, scene: str, facts: dict[str, Any], gain: float) -> F4:
    """On touched film, away from the edges of shadows and from walls."""
    result = rendered(data / "hand_ideal" / scene / "truth_height_mm.npy", facts)
    image, labels, height = images(data / rig / scene), result["labels"], result["height"]
    steep = np.hypot(*np.gradient(height, facts["pixel_size_mm"])) > 3
    window = np.ones((5, 5), np.uint8)
    calm = (cv2.dilate(steep.astype(np.uint8), window) == 0) & (height > 0.02)
    edges = np.stack(
        [cv2.morphologyEx(labels >> k & 1, cv2.MORPH_GRADIENT, window) for k in range(4)]
    )
    counts = calm & (edges == 0) & (image < 254)
    return (gain * result["light"] - image)[counts]


def images(folder: Path) -> F4:
    """K x H x W, in grey levels."""
    planes = (cv2.imread(str(folder / f"led{k}.png"), cv2.IMREAD_UNCHANGED) for k in range(1, 5))
    return np.stack(list(planes)).astype(np.float32)


def rendered(height: Path, facts: dict[str, Any]) -> dict[str, Any]:
    """What the rig's camera would see of a shape."""
    coat, disc = facts.get("coating") or {}, facts.get("led_disc_radius_mm") or 0
    bounce = facts["albedo"] if facts.get("bounces") else 0
    with tempfile.TemporaryDirectory() as folder:
        graph = Path(folder) / "rig.yaml"
        graph.write_text(GRAPH.format(file=height, disks=str(disc > 0).lower()))
        pipeline = load(
            str(graph),
            out=Path(folder) / "out",
            led_size_mm=2 * disc,
            albedo=facts["albedo"],
            bounce_albedo=bounce,
            coat_alpha=coat.get("roughness", 0),
            refractive_index=coat.get("refractive_index", 1.5),
            camera_mm=facts.get("camera_mm") or 0,
            lens_at_corner=facts.get("lens_at_corner") or 0,
            blur_px=facts.get("blur_px") or 0,
            pixel_size_mm=facts["pixel_size_mm"],
            backend="opencl",
        )
        return dict(pipeline())


if __name__ == "__main__":
    main()
