# SPDX-License-Identifier: MIT
"""What a study comes to, in sentences: nothing is said that was not measured."""

from __future__ import annotations

from collections.abc import Iterator

from fenics_hytf.study.knobs import LABELS
from fenics_hytf.study.records import (
    SAME,
    TARGETS,
    WORTH,
    Comparison,
    Study,
    cheapest,
    core_s,
    error_of,
    measured,
)
from fenics_hytf.study.slip_measures import SLIP
from fenics_hytf.study.time_domain import METHODS


def sentences(study: Study) -> Iterator[str]:
    """What follows from a study.

    Args:
        study: The study.

    Yields:
        Sentences, the ones on the targets first.
    """
    for target in TARGETS:
        yield _for_target(study, target)
    yield from _own(study)
    yield from _bottleneck(study)
    yield from _idle(study)
    yield from _slip(study)
    yield from _twin(study.twin)


def percent(error: float) -> str:
    """An error in per cent, two digits."""
    return f"{100 * error:.2g} %"


def seconds(value: float) -> str:
    """Core-seconds, two digits."""
    return f"{value:.2g} core-s" if value < 100 else f"{value:.0f} core-s"


def _slip(study: Study) -> Iterator[str]:
    """The same of the slip: what is cheapest of all that was run, and what holds it back."""
    seen = study.of_slip()
    if seen is None:
        return
    for target in TARGETS:
        yield f"Slip, {_for_target(seen, target)}"
    slip = f"{study.own.slid[SLIP]:.3g} m"
    if seen.own == seen.finest:
        yield f"Slip of the scene as it is: {slip}."
        return
    off = percent(error_of(seen.own))
    if seen.reference.pending:
        doubt = "the uncertainty of the reference is not known yet"
        yield f"Slip of the scene as it is: {slip}, {off} off; {doubt}."
    else:
        doubt = percent(seen.reference.uncertainty)
        yield f"Slip of the scene as it is: {slip}, {off} ± {doubt} off."
    yield from (f"Slip: {sentence}" for sentence in _bottleneck(seen))


def _for_target(study: Study, target: float) -> str:
    """The cheapest setting that was measured within an error."""
    point = cheapest(study.points, target)
    if point is None:
        best = min(measured(study.points), key=error_of, default=None)
        if study.reference.uncertainty > target:
            doubt = percent(study.reference.uncertainty)
            return f"{percent(target)}: not told; the reference itself is uncertain by {doubt}."
        text = "nothing was measured" if best is None else f"the best was {percent(error_of(best))}"
        return f"{percent(target)}: not reached; {text}."
    own = study.own
    ratio = "" if point is own else f", {core_s(point) / core_s(own):.2g} of the scene's own"
    doubt = f" ± {percent(point.doubt)}" if point.doubt and not point.resolved else ""
    return (
        f"{percent(target)}: cheapest is {point.name}: {percent(error_of(point))}{doubt} at "
        f"{seconds(core_s(point))}{ratio}."
    )


def _own(study: Study) -> Iterator[str]:
    own = study.own
    if own == study.finest:
        yield f"The scene as it is, {seconds(core_s(own))}, is the finest that was run."
        return
    assert own.error is not None  # without it there is no study
    yield (
        f"The scene as it is: {percent(error_of(own))}, ln PSA within {own.error.ln_psa:.2g}, "
        f"worst at {own.error.receiver}, {seconds(core_s(own))}."
    )


def _bottleneck(study: Study) -> Iterator[str]:
    """The knob that, turned alone to its fine value, takes most from the scene's own error."""
    own = study.own
    if own == study.finest:
        return
    gains = [
        point
        for point in measured(study.points)
        if "from own" in point.families
        and len(point.turned) == 1
        and error_of(point) < error_of(own)
    ]
    best = min(gains, key=error_of, default=None)
    if best is None or error_of(best) * SAME > error_of(own):
        yield "No knob turned alone makes the scene much better: none is the bottleneck."
        return
    yield (
        f"The bottleneck is the {LABELS[best.turned[0]]}: {best.name} alone takes the error from "
        f"{percent(error_of(own))} to {percent(error_of(best))}, at "
        f"{core_s(best) / core_s(own):.2g} times the cost."
    )


def _idle(study: Study) -> Iterator[str]:
    """The knob that costs most for nothing."""
    own = study.own
    if own == study.finest:
        return
    spare = [
        point
        for point in measured(study.points)
        if len(point.turned) == 1
        and error_of(point) <= SAME * error_of(own)
        and core_s(point) < WORTH * core_s(own)
    ]
    best = min(spare, key=core_s, default=None)
    if best is not None:
        yield (
            f"Most is spent for nothing on the {LABELS[best.turned[0]]}: {best.name} costs "
            f"{core_s(best) / core_s(own):.2g} of the scene as it is, and its error is "
            f"{percent(error_of(best))}."
        )


def _twin(twin: Comparison) -> Iterator[str]:
    """For each target who is cheaper, frequency domain or time domain."""
    if twin.reference is None:
        yield f"No comparison with the time domain: {twin.reason}."
        return
    marches = [p for p in measured(twin.points) if p.families[0] in METHODS]
    sweeps = [p for p in measured(twin.points) if p.families[0] == "reduced"]
    direct = [p for p in twin.points if p.families[0] == "direct" and p.cost]
    if not marches:
        yield "No comparison with the time domain: no march in time was measured."
        return
    for target in TARGETS:
        march = cheapest(marches, target)
        sweep = min([*filter(None, [cheapest(sweeps, target)]), *direct], key=core_s, default=None)
        if sweep is None:
            continue
        if march is None:
            best = percent(error_of(min(marches, key=error_of)))
            yield (
                f"Viscous twin, {percent(target)}: {sweep.name}, {seconds(core_s(sweep))}; no "
                f"march in time gets there ({best} at best)."
            )
            continue
        first, second = sorted((sweep, march), key=core_s)
        if core_s(first) > WORTH * core_s(second):
            yield (
                f"Viscous twin, {percent(target)}: {first.name} and {second.name} cost about the "
                f"same, {seconds(core_s(first))} and {seconds(core_s(second))}."
            )
            continue
        yield (
            f"Viscous twin, {percent(target)}: {first.name} wins, {seconds(core_s(first))}, "
            f"{core_s(second) / core_s(first):.2g} times cheaper than {second.name}."
        )
