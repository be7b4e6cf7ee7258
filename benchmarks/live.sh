#!/bin/sh
# A sensor made of software, pressed by a moving ball, reconstructed as it runs: 640 x 480
# pixels, 30 camera frames a second, or RATE.  live.sh FOLDER [SECONDS]; without SECONDS until
# Ctrl-C.  COAT=1 takes the time of a coated film that lights itself; heights are wrong then, since
# the camera shows a matt one.
set -e
tactograph=${TACTOGRAPH:-tactograph}
out=$1
rig="slant_deg=33 distance_mm=60"
camera="simulated?slant_deg=33&distance_mm=60&radius_mm=4&depth_mm=1&path_mm=3"
size="width_px=640 height_px=480 pixel_size_mm=0.0357142857"

if [ ! -f "$out/cal.npz" ]; then
    echo "--- calibrate the simulated sensor: a 7 mm ball, and the film at rest"
    $tactograph run simulate out="$out/ball" radius_mm=7 seed=1 $rig $size --quiet
    $tactograph run simulate_flat out="$out/flat" seed=2 $rig $size --quiet
    $tactograph run calibrate capture="$out/ball" flat="$out/flat" ball_radius_mm=7 \
        pixel_size_mm=0.0357142857 out="$out/cal.npz" --quiet
fi
calibration="$out/cal.npz"
if [ -n "$COAT" ]; then
    calibration="$out/coat.npz"
    ${PYTHON:-python} -c "
import numpy as np
coat = dict(base=0.7, roughness=0.2, refraction=1.5, albedo=0.7, rim=2, camera=1 / 65)
np.savez('$calibration', **dict(np.load('$out/cal.npz')) | {n: np.float32(v) for n, v in coat.items()})"
fi
echo "--- live: LEDs flash, the camera runs, a ball moves; Ctrl-C ends it"
exec $tactograph run live calibration="$calibration" camera="$camera" port=simulated \
    rate="${RATE:-30}" seconds="${2:-null}" out="$out" --quiet
