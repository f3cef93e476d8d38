"""``rover-sim score``: what was perceived in pictures against labels that people made."""

from __future__ import annotations

import argparse
from pathlib import Path

from rover_sim.arguments import worker_count
from rover_sim.learning import KINDS
from rover_sim.parallel import cores


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_labels(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("scored"), help="default: scored")
    parser.add_argument(
        "--knowledge", default="mars", metavar="NAME", help="mars, rendered or a TOML file (default: mars)"
    )


def add_labels(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say which labels."""
    parser.add_argument("--images", type=Path, nargs="+", metavar="DIR", required=True, help="folders of pictures")
    parser.add_argument("--labels", type=Path, metavar="DIR", required=True, help="folder of their labels")
    parser.add_argument("--kind", choices=tuple(KINDS), default="rocks", help="of the labels (default: rocks)")
    parser.add_argument(
        "--workers", type=worker_count, default=cores(), metavar="N", help="processes (default: all cores)"
    )


def execute(args: argparse.Namespace) -> int:
    """Score all labelled pictures, write the report and print its figures."""
    from rich.console import Console

    from rover_sim.learning import kind_module
    from rover_sim.learning.labels import label_pairs

    kind = kind_module(args.kind)
    lines = kind.score(label_pairs(args.images, args.labels, kind.label_of), args.knowledge, args.out, args.workers)
    Console().print("\n".join(lines), soft_wrap=True, highlight=False, markup=False)
    return 0
