#!/bin/sh
# A ROS 2 for the tests of what publishes and subscribes, in an environment of its own: these
# wheels start Python anew at every start of it.  Without them the tests are skipped.
set -eu
PLACE=$1
PYTHON=$2
[ "$(uname -sm)" = "Linux x86_64" ] || exit 0
"$PYTHON" -m venv "$PLACE"
"$PLACE/bin/python" -m pip install --quiet --disable-pip-version-check 'ros-rclpy[fastrtps]>=7' ros-sensor-msgs ros-diagnostic-msgs || {
    rm -rf "$PLACE"
    echo "no ROS 2 for this Python: its tests are skipped" >&2
}
