"""``tactograph demo``: from a simulated sensor to a height, by the commands that a user types."""

import shlex
from pathlib import Path

import click

from tactograph.graph.commands import FOLDER_PATH
from tactograph.graph.errors import TactographError

DEMO_STEPS = """
# What computes here.
tactograph devices
# A simulated sensor: a ball of 7 mm radius to calibrate with, the film at rest, and a touch.
tactograph run simulate radius_mm=7 seed=1 out=OUT/ball --quiet
tactograph run simulate_flat seed=2 out=OUT/flat --quiet
tactograph run simulate radius_mm=5 seed=3 out=OUT/touch --quiet
# Calibrate.
tactograph run calibrate capture=OUT/ball flat=OUT/flat ball_radius_mm=7 \
pixel_size_mm=0.07142857 out=OUT/cal.npz
# Reconstruct the touch, half a ball of 5 mm radius.
tactograph run reconstruct capture=OUT/touch calibration=OUT/cal.npz out=OUT/result
# Compare with and without shadow handling, by the first two figures, as Table 1 of the paper does.
# RMSE says otherwise: unhandled, the shadow beside the ball counts as a slope, which lifts the ball
# by part of what its steep rim loses; that mends the mean height, but neither rim nor normals.
tactograph compare paper paper_no_shadow reconstruct precise --over OUT/touch \
calibration=OUT/cal.npz --out OUT/report
"""


@click.command("demo", short_help="Simulate a sensor, calibrate it, reconstruct a touch.")
@click.option(
    "--out", type=FOLDER_PATH, default="demo", show_default=True, help="The folder to write to."
)
def command(out: Path) -> None:
    """Simulate a sensor, calibrate it and reconstruct a touch; show each command that does it."""
    from tactograph.graph.command import run_command
    from tactograph.graph.compare.tables import read_rows
    from tactograph.graph.extras import need

    need("report", "the report of the demo", "jinja2")
    last = ""
    for line in DEMO_STEPS.strip().splitlines():
        begins, last = not last.startswith("#"), line
        if line.startswith("#"):
            click.secho("\n" * begins + line, bold=True)
            continue
        line = line.replace("OUT", shlex.quote(str(out)))
        click.echo(f"$ {line}")
        run_command(shlex.split(line)[1:])
    if failed := [row for row in read_rows(out / "report") if row.error]:
        names = ", ".join(row.variant for row in failed)
        raise TactographError(f"demo: {names} failed: {failed[0].error}")
    click.echo(f"\nLook at {out}/cal.png, {out}/result/height.png and {out}/report/report.html")
