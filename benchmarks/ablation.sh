#!/bin/sh
# Every figure and picture of docs/ablation.md.  Usage: benchmarks/ablation.sh [FOLDER]
# What was finished before is not run again, so it can be stopped and started.
set -eu
HERE=$(cd "$(dirname "$0")" && pwd)
OUT=${1:-out/ablation}
compare="${TACTOGRAPH:-tactograph} compare"

# Table 1: which light gives figures like the paper's?
$compare table1 table1_no_shadow --out "$OUT/geometry" \
    --sweep lights.slant_deg=10,28,30,32,34,45 --sweep lights.distance_mm=200,380,2000
# The same at the light nearest to it, with the camera's noise, five times.
$compare table1 table1_best_threshold table1_no_shadow shot_noise=true read_noise=10 \
    --seed camera.seed --repeats 5 --out "$OUT/noise"
# The paper's test with three deviations as its threshold, and with the best on its own press.
$compare table1 table1_best_threshold table1_no_shadow --out "$OUT/threshold"
for shape in teapot cat; do
    file="$HERE/ablation/$shape.yaml"
    $compare "$file" "$file/best_threshold" "$file/no_shadow" --out "$OUT/threshold_$shape"
done
# With and without, over the slant of the light.
SLANTS="--sweep lights.slant_deg=15..60:7"
$compare table1 table1_no_shadow $SLANTS --out "$OUT/ball"
for shape in teapot cat; do
    $compare "$HERE/ablation/$shape.yaml" "$HERE/ablation/$shape.yaml/no_shadow" \
        $SLANTS --out "$OUT/$shape"
done
"${PYTHON:-python3}" "$HERE/ablation_pictures.py" "$OUT" "$HERE/../docs/pictures"
