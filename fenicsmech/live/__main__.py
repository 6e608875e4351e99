"""``python3 -m fenicsmech.live``: opens the live page.

python3 -m fenicsmech.live [PROJECT.json] [--example NAME] [--port PORT] [--no-browser]
"""

import argparse
from pathlib import Path

from fenicsmech.live.project import example, example_names, load_project
from fenicsmech.live.server import ServerOptions, serve


def main() -> None:
    """Reads the options and serves."""
    parser = argparse.ArgumentParser(prog="python3 -m fenicsmech.live", description="A mechanism to hold in your hand.")
    parser.add_argument("project", nargs="?", type=Path, help="file saved by the page")
    parser.add_argument("--example", choices=example_names(), default="truss-finger", help="shown without a file")
    parser.add_argument("--port", type=int, default=0, help="of 127.0.0.1; a free one by default")
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    options = parser.parse_args()
    project = load_project(options.project) if options.project else example(options.example)
    serve(project, options=ServerOptions(port=options.port), browse=not options.no_browser)


if __name__ == "__main__":
    main()
