#!/bin/sh
# A one-shot colour sensor made of software, calibrated by a hand made of software and pressed by
# a moving ball: 30 colour frames a second.  live_oneshot.sh FOLDER [SECONDS]; without SECONDS
# until Ctrl-C.
set -e
tactograph=${TACTOGRAPH:-tactograph}
out=$1
mkdir -p "$out"

if [ ! -f "$out/mini.npz" ]; then
    echo "--- calibrate: 20 presses of a ball of 6.31 mm"
    $tactograph run calibrate_live_oneshot sensor=gelsight_mini ball_radius_mm=3.155 \
        camera="simulated?by_hand=true&press_s=1.6&path_mm=8" presses_at_most=20 \
        out="$out/mini.npz"
fi
echo "--- live: three colours at once, the camera runs, a ball moves; Ctrl-C ends it"
exec $tactograph run live_oneshot sensor=gelsight_mini calibration="$out/mini.npz" \
    camera="simulated" seconds="${2:-null}" out="$out" --quiet
