#!/bin/sh
# A one-shot colour sensor, calibrated by a hand made of software, and heights from its camera's
# 30 colour frames a second while a ball moves.  live_oneshot.sh FOLDER [SECONDS] [SIZE]
#
# SIZE is 320x240 (as given) or another of the same shape.  The sensor is a video of a simulated
# one, played at its own rate: what a camera costs, and no more.  SECONDS=null simulates it
# while it runs instead, until Ctrl-C.
set -e
tactograph=${TACTOGRAPH:-tactograph}
python=${PYTHON:-python}
out=$1 seconds=${2:-null} size=${3:-320x240}
width=${size%x*} height=${size#*x}
mkdir -p "$out"

preset="$out/mini_$size.yaml"
pixel=$(awk "BEGIN {printf \"%.6f\", 20.288 / $width}")
cat >"$preset" <<END
format: 1
title: A GelSight Mini whose frames are $size
camera: {width: $width, height: $height, rate: 30}
size: [$width, $height]
lights: bgr
pixel_size_mm: $pixel
warm_up_s: 0
END

if [ ! -f "$out/mini_$size.npz" ]; then
    echo "--- calibrate: 20 presses of a ball of 6.31 mm"
    $tactograph run calibrate_live_oneshot sensor="$preset" ball_radius_mm=3.155 \
        camera="simulated?by_hand=true&press_s=1.6&path_mm=8" presses_at_most=20 \
        out="$out/mini_$size.npz"
fi
if [ "$seconds" = null ]; then
    camera=simulated
else
    camera="$out/film_${size}_$seconds.avi"
    [ -f "$camera" ] ||
        $python "$(dirname "$0")/oneshot_film.py" "$camera" "$size" "$seconds"
fi
echo "--- live: three colours at once, the camera runs, a ball moves; Ctrl-C ends it"
exec $tactograph run live_oneshot sensor="$preset" calibration="$out/mini_$size.npz" \
    camera="$camera" seconds="$seconds" out="$out" --quiet
