"""The score as Markdown."""

from __future__ import annotations

from typing import Any


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def _share(hits: int, count: int) -> str:
    return f"{hits} / {count}" if count else "-"


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _table(header: list[str], rows: list[list[str]]) -> list[str]:
    return [_line(header), _line(["---"] * len(header)), *(_line(row) for row in rows)]


def figure_table(figures: list[dict[str, Any]]) -> list[str]:
    """Section 4 of the protocol, line by line."""
    rows = []
    for f in figures:
        if f["value"] is None:
            continue
        if f["successes"] is not None:
            value = f"{100 * f['value']:.1f} %"
            interval = f"{100 * f['low']:.1f} to {100 * f['high']:.1f} %"
            count = f"{f['successes']} / {f['count']} {f['unit']}"
        else:
            value, interval, count = _number(f["value"]), "", f"{f['count']} {f['unit']}"
        aim = ""
        if f["target"] is not None:
            low, high = f["target"]
            if high >= 1:
                bounds = f"at least {100 * low:.0f} %"
            else:
                bounds = f"at most {100 * high:.0f} %" if low <= 0 else f"{100 * low:.0f} to {100 * high:.0f} %"
            aim = f"{bounds}: {'met' if f['met'] else 'missed'}"
        rows.append([f["text"], f["on"], value, interval, count, aim])
    return _table(["figure", "on", "value", "95 % (Wilson)", "count", "aim"], rows)


def effect_table(effects: list[dict[str, Any]]) -> list[str]:
    rows = []
    for e in effects:
        said = ", ".join(f"{label} {count}" for label, count in sorted(e["withheld_said"].items(), key=lambda i: -i[1]))
        rows.append(
            [
                f"`{e['effect']}`",
                e["stage"] + ("" if e["in_catalogue"] else " (outside)"),
                _number(e["detectability"]),
                _share(e["exact"], e["sets"]),
                _share(e["included"], e["sets"]),
                _number(e["relative_error"], 2),
                _share(e["intervals_held"], e["intervals"]),
                said or "-",
            ]
        )
    header = ["effect", "stage", "median of the largest z", "exact", "or among equivalents"]
    return _table([*header, "median relative error", "intervals that hold", "where it was withheld"], rows)


def bin_table(rows: list[dict[str, Any]], what: str) -> list[str]:
    lines = []
    for row in rows:
        if not row["sets"]:
            continue
        high = "" if row["high"] is None else f" to {row['high']:g}"
        shares = [f"{100 * row[name]['share']:.0f} %" for name in ("detected", "exact", "included")]
        lines.append([f"{row['low']:g}{high}" if high else f"above {row['low']:g}", str(row["sets"]), *shares])
    return _table([what, "sets", "noticed", "exactly named", "or among the equivalents"], lines)


def name_table(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        [f"`{r['effect']}`", _share(r["named"], r["sets"]), _share(r["hidden_named"], r["hidden"]), str(r["false"])]
        for r in rows
    ]
    return _table(["effect", "named", "named where it was hidden", "false names"], lines)


def calibration_table(levels: list[dict[str, Any]]) -> list[str]:
    rows = []
    for row in levels:
        share = f"{100 * row['held'] / row['count']:.0f} %"
        low, high = (100 * bound for bound in row["wilson95"])
        rows.append(
            [f"{100 * row['level']:.0f} %", share, f"{low:.0f} to {high:.0f} %", _share(row["held"], row["count"])]
        )
    return _table(["central interval", "holds the truth", "95 % (Wilson)", "parameters"], rows)


def rung_table(rows: list[dict[str, Any]]) -> list[str]:
    lines = []
    for row in rows:
        verdicts = ", ".join(f"{name} {count}" for name, count in sorted(row["verdicts"].items(), key=lambda i: -i[1]))
        counts = [_share(row["recalled"], row["true"]), _share(row["named_true"], row["named"])]
        lines.append([row["rung"], verdicts, *counts])
    return _table(["rung", "verdicts", "true effects that are named", "named effects that are true"], lines)


def markdown(score: dict[str, Any], title: str = "The withheld-effect check") -> str:
    """The whole score; its figures lie beside it."""
    kinds = ", ".join(f"{count} {kind}" for kind, count in score["sets"].items())
    lines = [f"# {title}", "", f"Sets: {kinds}."]
    if score["missing"]:
        lines.append(f"Not diagnosed, and left out: {len(score['missing'])} ({', '.join(score['missing'][:10])} ...).")
    if score["time_s"]:
        times = score["time_s"]
        lines.append(f"Time of a set: median {times['median']:.1f} s, at most {times['max']:.1f} s.")
    if score["peak_memory_mib"]:
        lines.append(f"Memory: at most {score['peak_memory_mib']:.0f} MiB.")
    lines += ["", *figure_table(score["figures"]), ""]
    if any(row["sets"] for row in score["strength"]):
        lines += ["## Accuracy against strength (0: weak, 1: strong)", ""]
        lines += [*bin_table(score["strength"], "strength"), ""]
        lines += ["## Accuracy against detectability", ""]
        lines += [*bin_table(score["detectability"], "largest z"), ""]
    if score["effects"]:
        lines += ["## Effect by effect", "", *effect_table(score["effects"]), ""]
    if sum(score["calibration"]["ranks"]):
        lines += ["## Intervals at every level", "", *calibration_table(score["calibration"]["levels"]), ""]
    if score["names"]:
        lines += ["## Names in whole cameras", "", *name_table(score["names"]), ""]
    if score["rungs"]:
        lines += ["## Rung by rung", "", *rung_table(score["rungs"]), ""]
    if score["wrong"]:
        rows = []
        for w in score["wrong"]:
            strength = w["strength"] or {}
            truth = ", ".join(
                f"{name} {strength[name]:.2f}" if isinstance(strength, dict) and name in strength else name
                for name in w["truth"]
            )
            said = w["verdict"] + (": " + ", ".join(w["effects"]) if w["effects"] else "")
            worst = " ".join(str(w["worst"][k]) for k in ("sequence", "statistic") if w["worst"].get(k))
            rows.append([w["set"], w["kind"], truth or "nothing", said, _number(w["detectability"]), worst])
        header = ["set", "kind", "truth and strength", "said", "largest z", "worst statistic"]
        lines += ["## Sets that did not come out right", "", *_table(header, rows), ""]
    return "\n".join(lines)
