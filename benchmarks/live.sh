#!/bin/sh
# A sensor made of software, pressed by a moving ball, reconstructed as it runs: 640 x 480
# pixels, 30 camera frames a second, or RATE.  live.sh FOLDER [SECONDS]; without SECONDS until
# Ctrl-C.
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
echo "--- live: LEDs flash, the camera runs, a ball moves; Ctrl-C ends it"
exec $tactograph run live calibration="$out/cal.npz" camera="$camera" port=simulated \
    rate="${RATE:-30}" seconds="${2:-null}" out="$out" --quiet
