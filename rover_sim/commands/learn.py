"""``rover-sim learn``: from labelled pictures to a knowledge file, with a cross-validated report beside it."""

from __future__ import annotations

import argparse
from pathlib import Path

from rover_sim.commands.score import add_labels
from rover_sim.errors import InputError


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_labels(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.toml",
        required=True,
        help="knowledge file to write; the report goes beside it, as FILE.json and FILE.png",
    )
    parser.add_argument(
        "--base", default="mars", metavar="NAME", help="knowledge that the rest is taken from (default: mars)"
    )
    parser.add_argument(
        "--outlines",
        type=Path,
        metavar="DIR",
        help="kind grid: pictures with STEM_mask.png, for rock evidence from other scenes in the report",
    )


def execute(args: argparse.Namespace) -> int:
    """Learn, write knowledge and report, and print the figures of the cross-validation."""
    from rich.console import Console

    from rover_sim.learning import kind_module
    from rover_sim.learning.labels import label_pairs

    if args.out.suffix != ".toml":
        raise InputError(f"--out {args.out}: must be named FILE.toml, as knowledge files are")
    if args.outlines is not None and args.kind != "grid":
        raise InputError(f"--outlines {args.outlines}: only --kind grid takes it")
    kind = kind_module(args.kind)
    more = {"outlines": args.outlines} if args.kind == "grid" else {}
    pairs = label_pairs(args.images, args.labels, kind.label_of)
    lines = kind.learn(pairs, args.base, args.out, args.workers, **more)
    Console().print("\n".join(lines), soft_wrap=True, highlight=False, markup=False)
    return 0
