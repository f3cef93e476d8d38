"""``report.json`` and ``report.html`` of a trial suite: a row a cell, and every failure with its run folder."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from rover_sim import __version__
from rover_sim.files import atomic_path, write_json, write_text
from rover_sim.report.reliability_plot import draw_reliability
from rover_sim.trials.reliability import curves
from rover_sim.trials.reliability import figures as forecast_figures
from rover_sim.trials.statistics import cells, figures
from rover_sim.trials.trial import Row

JSON, HTML, RELIABILITY = "report.json", "report.html", "reliability.png"
_MEANS = {
    "spl": "SPL",
    "path_inefficiency": "path inefficiency",
    "score": "score",
    "sim_time_s": "time, s",
    "max_tilt_deg": "largest tilt, deg",
    "mean_slip": "mean slip",
    "energy_J": "energy, J",
    "real_time_factor": "real-time factor",
}
_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 2em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; }
th, td { border-bottom: 1px solid #ccc; padding: .3em .7em; text-align: right; white-space: nowrap; }
th { background: #f2efe9; } td.text, th.text { text-align: left; white-space: normal; }
td.bad { background: #f6d5cc; } caption { text-align: left; font-weight: bold; padding: .4em 0; }
"""


def write(folder: Path, rows: Sequence[Row], planned: int) -> dict[str, Any]:
    """Write both files and return the content of ``report.json``; ``planned`` trials were asked for.

    Where there are forecasts enough, their reliability diagram is a picture beside them.
    """
    content = report(rows, planned)
    if drawn := curves(rows):
        with atomic_path(folder / RELIABILITY) as path:
            draw_reliability(drawn, path)
    write_json(folder / JSON, content)
    write_text(folder / HTML, page(content, rows))
    return content


def report(rows: Sequence[Row], planned: int) -> dict[str, Any]:
    """The content of ``report.json``."""
    return {
        "version": __version__,
        "complete": len(rows) >= planned,
        "planned": planned,
        "total": figures(rows),
        "cells": cells(rows),
        "reliability": forecast_figures(rows),
        "failures": [
            {
                "key": row.key,
                "reason": row.reason,
                "detail": row.error or row.metrics.get("detail", ""),
                "violations": row.metrics.get("violations", []),
                "refused": bool(row.metrics.get("refused")),
                "run_folder": row.metrics.get("run_folder"),
            }
            for row in rows
            if not row.success or row.metrics.get("violations")
        ],
    }


def page(content: dict[str, Any], rows: Sequence[Row]) -> str:
    """The report as a page that needs nothing but the run folders it links to."""
    total, suites = content["total"], ", ".join(dict.fromkeys(row.suite for row in rows))
    state = "" if content["complete"] else f" (not complete: {len(rows)} of {content['planned']} trials)"
    head = (
        f"<h1>Trials: {escape(suites)}</h1><p>{total['successes']} of {total['n']} succeed{state}; "
        f"Wilson 95 % interval {100 * total['wilson_low']:.1f} to {100 * total['wilson_high']:.1f} %; "
        f"{total['safety_violations']} with a safety violation; rover-sim {content['version']}.</p>"
    )
    body = head + _cell_table(content["cells"]) + _reliability(content["reliability"])
    body += _failure_table(content["failures"])
    notes = (
        "<p>Reachable: a way exists on the true map for half the rover's width past what is higher than its belly. "
        "Refused: the rover gave up, and there was none. SPL over reachable worlds, against that way; "
        "path inefficiency (driven over straight line, less one) and time over successes.</p>"
    )
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Trials: {escape(suites)}</title>'
        f"<style>{_STYLE}</style></head><body>{body}{notes}</body></html>\n"
    )


def _cell_table(found: Sequence[dict[str, Any]]) -> str:
    shown = {name: text for name, text in _MEANS.items() if any(name in cell["means"] for cell in found)}
    titles = ["cell", "n", "successes", "rate, %", "95 %", "reachable", "refused", "unsafe", *shown.values(), "reasons"]
    lines = [_line("th", titles, text_columns=(0, len(titles) - 1))]
    for cell in found:
        name = ", ".join(f"{key} {value}" for key, value in cell["cell"].items())
        values = [f"{cell['means'][key]:.3g}" if key in cell["means"] else "" for key in shown]
        interval = f"{100 * cell['wilson_low']:.1f} to {100 * cell['wilson_high']:.1f}"
        reasons = ", ".join(f"{reason} {count}" for reason, count in cell["reasons"].items())
        numbers = [
            cell["n"],
            cell["successes"],
            f"{100 * cell['rate']:.1f}",
            interval,
            cell["reachable"],
            cell["refused"],
        ]
        unsafe = ", ".join(f"{kind} {count}" for kind, count in cell["violations"].items()) or "0"
        columns = [name, *map(str, numbers), unsafe, *values, reasons]
        lines.append(_line("td", columns, text_columns=(0, len(columns) - 1), bad=7 if cell["violations"] else None))
    return f"<table><caption>Cells</caption>{''.join(lines)}</table>"


def _reliability(found: dict[str, dict[str, float]]) -> str:
    """Forecasts of risk against what happened; empty without enough of them."""
    if not found:
        return ""
    titles = ["forecast of", "n", "forecast, %", "happened, %", "Brier", "base", "better than the base by, %", "ECE"]
    lines = [_line("th", titles, text_columns=(0,))]
    for name, one in found.items():
        shares = [f"{100 * one[key]:.1f}" for key in ("forecast", "happened")]
        scored = [f"{one['brier']:.4f}", f"{one['base']:.4f}", f"{100 * one['skill']:.0f}", f"{one['ece']:.3f}"]
        lines.append(_line("td", [name, f"{one['n']}", *shares, *scored], text_columns=(0,)))
    picture = f'<img src="{RELIABILITY}" alt="How often what was forecast came true">'
    happens = any(one["happened"] > 0.0 for one in found.values())
    return f"<table><caption>Risk forecasts</caption>{''.join(lines)}</table>{picture if happens else ''}"


def _failure_table(failures: Sequence[dict[str, Any]]) -> str:
    if not failures:
        return "<p>No failures.</p>"
    lines = [_line("th", ["trial", "reason", "detail", "unsafe", "run folder"], text_columns=range(5))]
    for failure in failures:
        folder = failure["run_folder"]
        link = f'<a href="{escape(folder)}/map.png">map</a> <a href="{escape(folder)}/">folder</a>' if folder else ""
        reason = failure["reason"] + (" (refused)" if failure["refused"] else "")
        texts = [failure["key"], reason, failure["detail"], ", ".join(failure["violations"])]
        cells_html = "".join(f'<td class="text">{escape(text)}</td>' for text in texts)
        lines.append(f'<tr>{cells_html}<td class="text">{link}</td></tr>')
    return f"<table><caption>Failures and safety violations</caption>{''.join(lines)}</table>"


def _line(tag: str, texts: Sequence[str], text_columns: Sequence[int], bad: int | None = None) -> str:
    parts = []
    for place, text in enumerate(texts):
        style = "text" if place in text_columns else "bad" if place == bad else ""
        parts.append(f'<{tag} class="{style}">{escape(text)}</{tag}>' if style else f"<{tag}>{escape(text)}</{tag}>")
    return f"<tr>{''.join(parts)}</tr>"
