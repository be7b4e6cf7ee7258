"""The command ``tactograph``, also as ``python -m tactograph``."""

import signal
import sys

from tactograph import ctrl_c


def main() -> None:
    """Run the command line, and end in one line if Ctrl-C comes before or behind it."""
    ctrl_c.listen()
    try:
        from tactograph.graph.command import main as run

        ctrl_c.raise_heard()
        run()
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        print("tactograph: stopped", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
