"""Stress and endurance tests of the page's server: ``python tests/cockpit/endurance assault|soak``."""

from __future__ import annotations

import argparse
import json
import sys

import assault
import soak


def main() -> int:
    parser = argparse.ArgumentParser(prog="endurance", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True)
    attack = kinds.add_parser("assault", help="a server under attack while someone drives")
    attack.add_argument("--seconds", type=float, default=60.0, help="duration of each attack")
    attack.add_argument("--only", nargs="+", choices=assault.all_names(), default=assault.all_names())
    soaking = kinds.add_parser("soak", help="a page driven for a long time")
    soaking.add_argument("--minutes", type=float, default=30.0)
    soaking.add_argument("--scenario", help="as for drake-shared drive")
    for kind in (attack, soaking):
        kind.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    if options.kind == "assault":
        report, describe = assault.run(options.seconds, options.only), assault.describe
    else:
        report, describe = soak.run(options.minutes, options.scenario), soak.describe
    print(json.dumps(report) if options.json else describe(report))
    return 1 if report["broken"] else 0


if __name__ == "__main__":
    sys.exit(main())
