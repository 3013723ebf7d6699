"""The tables of measurements in the documentation, made from the CSV files in docs/measurements.

`plan.toml` says how each table is measured and laid out, `index.toml` where each CSV file comes from. A CSV file is of one of
two forms. A *study* has one row for each variant, setting and metric, with the columns of STATISTICS. A *flat* file is the
table itself: a column whose name ends with " ±" is half the 95 % interval of the column to its left.
"""

import csv
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

STORE: Final = Path(__file__).parent / "measurements"
STATISTICS: Final = (
    *("n", "mean", "sd", "half_width", "least", "most"),
    *("paper", "paper_is_bound", "agrees", "pairs", "difference", "difference_half_width"),
)
PROVENANCE: Final = ("source", "command", "commit", "date", "machine", "versions", "trials")
COMMAND_LENGTH_MAX: Final = 100
PERCENT_DIGIT_BELOW: Final = 0.01
ROUNDING: Final = 1e-9  # an interval smaller than this share of its mean is a rounding error
RECORDED: Final = "recorded"
MEASURED: Final = "measured"

Row = dict[str, str]


@dataclass(frozen=True)
class Measurement:
    """One stored measurement.

    `name` is that of its CSV file. `plan` is its table in plan.toml, `metrics` the labels of all metrics there, `origin` its
    table in index.toml, and `rows` the lines of its CSV file.
    """

    name: str
    plan: Mapping[str, Any]
    metrics: Mapping[str, Mapping[str, Any]]
    origin: Mapping[str, str]
    rows: Sequence[Row]

    @property
    def is_study(self) -> bool:
        """True if the CSV file has one row a metric, rather than the table as it is shown."""
        return bool(self.rows) and "metric" in self.rows[0]


def plans() -> dict[str, Any]:
    """Return plan.toml: `metrics` by name, and `tables` by name."""
    return tomllib.loads((STORE / "plan.toml").read_text(encoding="utf-8"))


def origins() -> dict[str, dict[str, str]]:
    """Return index.toml: where each CSV file comes from, by name."""
    path = STORE / "index.toml"
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def load(name: str) -> Measurement:
    """Return a stored measurement. Raises KeyError, with one line that says so, where a part of it is missing."""
    plan = plans()
    if name not in plan["tables"]:
        raise KeyError(f"{name}: plan.toml has no such table")
    table = plan["tables"][name]
    stored = table.get("of", name)
    if stored not in origins() or not (STORE / f"{stored}.csv").exists():
        raise KeyError(f"{name}: not measured yet, run: python docs/measure.py {stored}")
    with (STORE / f"{stored}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return Measurement(stored, table, plan["metrics"], origins()[stored], rows)


def render(name: str, to_store: str = "measurements") -> str:
    """Return a measurement as a Markdown table with its caption; `to_store` is the path from the page to the store."""
    found = shown_part(load(name))
    header, lines = _study(found) if found.is_study else _flat(found)
    return f"{markdown(header, lines)}\n\n{caption(found, to_store)}"


def shown_part(found: Measurement) -> Measurement:
    """Return a measurement with the rows only that its plan shows: those whose settings are `at`."""
    at = found.plan.get("at", {})
    return replace(found, rows=[row for row in found.rows if all(row[axis] in at[axis] for axis in at)])


def kind_of(found: Measurement, metric: str) -> tuple[str, dict[str, Any]]:
    """Return the name of a metric of a plan, and how it is shown; the plan says `NAME:most` for the most of all trials."""
    name, _, show = metric.partition(":")
    kind = dict(found.metrics.get(name, {"label": name}))
    return name, kind | {"label": f"{kind['label']}, {show}", "show": show} if show else kind


def markdown(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    table = [header, ["---"] * len(header), *lines]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in table)


def caption(found: Measurement, to_store: str) -> str:
    """Return what stands below a table: number of trials, meaning of ±, command, commit, date and machine."""
    origin = found.origin
    trials = origin["trials"]
    counted = f"n = {trials}." if trials[:1].isdigit() else f"{trials[:1].upper()}{trials[1:]}." if trials else ""
    parts = [counted, _meaning(found), found.plan.get("note", "")]
    where = f"commit `{origin['commit']}`, {origin['date']}, {origin['machine']}"
    if origin["source"] == RECORDED:
        where = f"at the earlier {where}, and not measured again since"
    command = origin["command"]
    if len(command) > COMMAND_LENGTH_MAX:
        command = f"python docs/measure.py {found.name}"
    parts.append(f"[Data](<{to_store}/{found.name}.csv>): `{command}`, {where}.")
    return " ".join(part for part in parts if part)


def _meaning(found: Measurement) -> str:
    if found.plan.get("spread") == "range":
        return "Least to most of all trials."
    if found.is_study and any(row["half_width"] for row in found.rows):
        starred = _is_paired(found) and (found.plan.get("layout") == "metrics" or found.plan.get("differences"))
        star = " `*`: the interval of the paired difference excludes zero." if starred else ""
        return f"Mean ± half its 95 % interval.{star}"
    return ""


# --- flat files -----------------------------------------------------------------------------------------------------


def _flat(found: Measurement) -> tuple[list[str], list[list[str]]]:
    columns = list(found.rows[0])
    shown = [name for name in columns if not name.endswith(" ±")]
    return shown, [[_with_interval(row, name) for name in shown] for row in found.rows]


def _with_interval(row: Row, name: str) -> str:
    half = row.get(f"{name} ±", "")
    return f"{_grouped(row[name])} ± {_grouped(half)}" if half else _grouped(row[name])


def _grouped(text: str) -> str:
    """Return a number of five digits or more with separators; other text as it is."""
    whole, point, rest = text.partition(".")
    return (
        f"{int(whole):,}{point}{rest}" if whole.isdigit() and len(whole) > 4 and rest.isdigit() | (not rest) else text
    )


# --- studies --------------------------------------------------------------------------------------------------------


def _study(found: Measurement) -> tuple[list[str], list[list[str]]]:
    return _by_metric(found) if found.plan.get("layout") == "metrics" else _by_point(found)


def axes_of(rows: Sequence[Row]) -> list[str]:
    """Return the columns of a study's CSV file that are settings."""
    return [name for name in rows[0] if name not in ("variant", "metric", *STATISTICS)]


def _is_paired(found: Measurement) -> bool:
    return any(row["difference"] for row in found.rows)


def _metrics(found: Measurement) -> list[str]:
    return found.plan.get("metrics") or list(dict.fromkeys(row["metric"] for row in found.rows))


def _name(found: Measurement, text: str) -> str:
    return str(found.plan.get("labels", {}).get(text, text))


def _by_metric(found: Measurement) -> tuple[list[str], list[list[str]]]:
    """Return a table with one line for each metric, and one column for each variant and paired difference."""
    variants = list(dict.fromkeys(row["variant"] for row in found.rows))
    rows = {(row["variant"], row["metric"]): row for row in found.rows}
    trials = {each: max(int(row["n"]) for row in found.rows if row["variant"] == each) for each in variants}
    required, paper = found.plan.get("required", {}), any(row["paper"] for row in found.rows)
    header = [""]
    for place, variant in enumerate(variants):
        header += [_name(found, variant)] + (["difference"] if place and _is_paired(found) else [])
    header += (["the paper"] if paper else []) + (["required"] if required else [])
    lines = []
    for each in _metrics(found):
        metric, kind = kind_of(found, each)
        line = [kind["label"]]
        first = rows.get((variants[0], metric))
        for place, variant in enumerate(variants):
            row = rows.get((variant, metric))
            line.append(value(row, kind, trials[variant], found.plan.get("spread", "")) if row else "")
            if place and _is_paired(found):
                line.append(difference(row, first, kind) if row else "")
        line += [published(first, kind) if first else ""] if paper else []
        lines.append(line + ([required.get(metric, "")] if required else []))
    return header, lines


def _by_point(found: Measurement) -> tuple[list[str], list[list[str]]]:
    """Return a table with one line for each setting and variant, and one column for each metric."""
    axes = axes_of(found.rows)
    kinds = [kind_of(found, each) for each in _metrics(found)]
    differences = found.plan.get("differences", ())
    points: dict[tuple[str, ...], dict[str, Row]] = {}
    for row in found.rows:
        points.setdefault((*(row[axis] for axis in axes), row["variant"]), {})[row["metric"]] = row
    several = len({point[-1] for point in points}) > 1
    paper = {row["metric"] for row in found.rows if row["paper"]}
    counts = [max(int(row["n"]) for row in rows.values()) for rows in points.values()]
    several_counts = len(set(counts)) > 1

    header = [_name(found, axis) for axis in axes] + ([_name(found, "variant")] if several else [])
    for metric, kind in kinds:
        header += [kind["label"]] + (["the paper"] if metric in paper and is_mean(kind) else [])
        header += ["difference"] if metric in differences else []
    lines = []
    for (point, rows), n in zip(points.items(), counts, strict=True):
        line = [_name(found, each) for each in (point if several else point[:-1])]
        for metric, kind in kinds:
            at = rows.get(metric)
            line.append(value(at, kind, n, found.plan.get("spread", "")) if at else "")
            line += [published(at, kind) if at else ""] if metric in paper and is_mean(kind) else []
            line += [difference(at, None, kind) if at else ""] if metric in differences else []
        lines.append(line + ([str(n)] if several_counts else []))
    header = ["" if each == "variant" else each for each in header]
    return header + (["n"] if several_counts else []), lines


def is_mean(kind: Mapping[str, Any]) -> bool:
    """True if the mean of a metric is shown, and not the least or most of all trials."""
    return kind.get("show") not in ("least", "most")


def value(row: Row, kind: Mapping[str, Any], trials: int, spread: str = "") -> str:
    """Return what is shown of a metric at a point: mean and interval, or the least or most of all trials.

    `spread` adds the standard deviation ("sd") to the mean, or shows the least and the most instead ("range"). Where fewer than
    all `trials` have a value, their number stands behind it; a time that none reached is `never`.
    """
    n = int(row["n"])
    if n == 0:
        return "never" if row["metric"].endswith("_s") else ""
    scale, unit = float(kind.get("scale", 1.0)), str(kind.get("unit", ""))
    if kind.get("show") == "count":
        return f"{round(float(row['mean']) * n)} of {n}"
    if kind.get("show") in ("least", "most"):
        return number(float(row[kind["show"]] or row["mean"]) * scale, kind.get("digits")) + unit
    few = f" ({n} of {trials})" if n < trials else ""
    if spread == "range":
        ends = [number(float(row[end]) * scale, kind.get("digits")) for end in ("least", "most")]
        return " to ".join(dict.fromkeys(ends)) + unit + few
    text = plus_minus(row["mean"], row["half_width"], scale, kind.get("digits")) + unit
    return text + (f" (sd {number(float(row['sd']) * scale)})" if spread == "sd" and row["sd"] else "") + few


def difference(row: Row, first: Row | None, kind: Mapping[str, Any]) -> str:
    """Return the paired difference from the first variant, with `*` where its interval excludes zero."""
    if not row["difference"]:
        return ""
    mean, half = float(row["difference"]), row["difference_half_width"]
    star = " *" if half and abs(mean) > float(half) else ""
    text = plus_minus(row["difference"], half, kind.get("scale", 1.0), kind.get("digits"))
    share = mean / float(first["mean"]) if first and float(first["mean"]) else 0.0
    return ("+" if mean > 0 else "") + text + star + percent(share)


def percent(share: float) -> str:
    """Return a relative difference in brackets; nothing for none."""
    if share == 0.0:
        return ""
    digits = 0 if abs(share) >= PERCENT_DIGIT_BELOW else 1
    return f" ({100.0 * share:+,.{digits}f} %)"


def published(row: Row, kind: Mapping[str, Any]) -> str:
    """Return the value that a paper prints, and whether ours agrees with it."""
    if not row["paper"]:
        return ""
    bound = "≥ " if row["paper_is_bound"] == "True" else ""
    agrees = {"True": "", "False": ", outside", "": ""}[row["agrees"]]
    return f"{bound}{number(float(row['paper']) * kind.get('scale', 1.0))}{kind.get('unit', '')}{agrees}"


def plus_minus(mean: str, half: str, scale: float = 1.0, digits: int | None = None) -> str:
    """Return `mean ± half`, or `mean` alone where there is no half.

    Both end at the second significant digit of the half, or at the first where only one is stored.
    """
    if not half:
        return number(float(mean) * scale, digits)
    spread = float(half) * scale
    if spread <= ROUNDING * abs(float(mean) * scale):
        return f"{number(float(mean) * scale, digits)} ± 0"
    if digits is None:
        stored = len(half.replace(".", "").strip("0")) if "e" not in half else 2
        digits = max(0, (1 if stored > 1 else 0) - math.floor(math.log10(spread)))
    return f"{number(float(mean) * scale, digits)} ± {number(spread, digits)}"


def number(amount: float, digits: int | None = None) -> str:
    """Return a number with `digits` decimals, or with four significant digits."""
    if digits is None:
        digits = max(0, 3 - math.floor(math.log10(abs(amount)))) if amount else 0
        text = f"{amount:,.{digits}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{amount:,.{digits}f}"
