"""Which sets are drawn: how many of each kind, and what is switched on in each."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from .camera import LONG_DARK, SEQUENCES, Camera, Sequence, draw_camera, stream
from .conditions import EVEN, draw_conditions
from .effects import CATALOGUE, EFFECTS, OUTSIDE, Effects, on_camera
from .generator import write_capture
from .json_file import read_object
from .readings import AS_CATALOGUED, CHOICES, Readings, draw_readings

# The kinds of sets: (a) null, (b) single, replica (single, the same set drawn again), level (single, at given
# strengths), (c) pair and many, (d) outside, (e) without; whole: a whole camera.
KINDS = ("null", "single", "replica", "level", "pair", "many", "outside", "without", "whole")

# What every sensor and lens has, one of each line: ten effects of a whole camera.
USUAL = (
    ("shot_noise",),
    ("prnu",),
    ("dsnu",),
    ("row_noise",),
    ("column_fpn", "row_fpn"),
    ("column_gain", "row_gain"),
    ("hot_pixels", "pixel_dull"),
    ("vignetting", "ambient_light"),
    ("crosstalk", "pixel_integration"),
    ("defocus", "aperture_mismatch"),
)


@dataclass(frozen=True)
class Plan:
    """How many sets of each kind. Lists of effects that are empty stand for all of them."""

    name: str
    width: int = 192
    height: int = 160
    frames: int = 40
    seed: int = 1
    nulls: int = 0
    singles_each: int = 0  # sets of each catalogued effect; strengths uniform, stratified from weak to strong
    single_effects: tuple[str, ...] = ()
    replica_groups: int = 0  # single effects whose sets are drawn again with other surfaces and noise
    replicas: int = 0
    pairs: int = 0
    many: int = 0  # sets with three to six effects
    outside_each: int = 0
    outside_effects: tuple[str, ...] = ()
    whole: int = 0  # cameras with ten usual effects and uneven light, every second one with a hidden effect more
    flat_exposures_ms: tuple[float, ...] = ()  # of further flats, beside the one of 10 ms
    without_each: int = 0
    without_effects: tuple[str, ...] = ()
    levels: dict[str, tuple[float, ...]] = field(default_factory=dict)  # effect: strengths
    minimum_strength: float = 0.0
    unit_phasor_share: float = 0.0  # sets whose baseline field is `unit_phasor`
    border_px: int = 0  # simulated on each side, but not recorded: images end where the world goes on
    other_cameras: bool = False  # each set's camera has a data sheet of its own
    other_readings: bool = False  # each set draws a reading of every line of the catalogue that leaves a choice

    def __post_init__(self) -> None:
        for names, known in (
            (self.single_effects, CATALOGUE),
            (self.without_effects, CATALOGUE),
            (self.outside_effects, OUTSIDE),
            (tuple(self.levels), EFFECTS),
        ):
            for name in names:
                if name not in known:
                    raise ValueError(f"plan {self.name!r}: no effect is called {name!r}; there are: {', '.join(known)}")
        if self.frames < 2 or min(self.width, self.height) < 40:
            raise ValueError(f"plan {self.name!r}: at least 2 frames of 40 x 40 pixels are needed")


PLANS = {
    # For continuous integration: minutes, not a measurement.
    "small": Plan(
        "small",
        width=96,
        height=80,
        frames=16,
        nulls=2,
        singles_each=1,
        single_effects=("defocus", "row_noise", "depolarization", "ghost_dots", "vignetting"),
        pairs=1,
        many=1,
        outside_each=1,
        outside_effects=("block_compression", "elliptical_pupil"),
        without_each=1,
        without_effects=("column_fpn",),
        minimum_strength=0.7,
    ),
    "medium": Plan(
        "medium",
        nulls=20,
        singles_each=2,
        pairs=15,
        many=8,
        outside_each=1,
        without_each=1,
        without_effects=tuple(list(CATALOGUE)[::3]),
    ),
    # False alarms alone, nuisances drawn.
    "nulls": Plan("nulls", width=128, height=96, frames=16, nulls=500),
    # Images cut out of larger ones, as all cameras' are: nothing wraps around at their borders.
    "cut": Plan("cut", nulls=60, singles_each=2, pairs=10, many=10, outside_each=1, border_px=24),
    # Cameras of other data sheets.
    "cameras": Plan("cameras", nulls=60, singles_each=2, pairs=10, many=10, outside_each=1, other_cameras=True),
    # Ten usual effects at once, in a lab whose lamp and beam are not even.
    "whole": Plan("whole", frames=24, whole=60),
    "full": Plan(
        "full",
        nulls=100,
        singles_each=6,
        replica_groups=6,
        replicas=6,
        pairs=50,
        many=30,
        outside_each=3,
        without_each=2,
    ),
}


def load_plan(name: str) -> Plan:
    """A plan by its name, or from a JSON file with the members of `Plan` (`base` names one to start from)."""
    if name in PLANS:
        return PLANS[name]
    path = Path(name)
    if not path.is_file():
        raise ValueError(f"plan {name!r} is neither one of {', '.join(PLANS)} nor a file")
    members = read_object(path)
    base = asdict(PLANS[members.pop("base")]) if "base" in members else {"name": path.stem}
    unknown = members.keys() - {f.name for f in fields(Plan)}
    if unknown:
        raise ValueError(f"plan {name!r}: unknown members {', '.join(sorted(unknown))}")
    merged = {**base, **members}
    for member in ("single_effects", "outside_effects", "without_effects", "flat_exposures_ms"):
        merged[member] = tuple(merged.get(member, ()))
    merged["levels"] = {name: tuple(strengths) for name, strengths in merged.get("levels", {}).items()}
    return Plan(**merged)


@dataclass(frozen=True)
class SetPlan:
    """One set: what is on, and the seeds of its camera and of its surfaces and noise."""

    kind: str
    strengths: dict[str, float]
    camera_seed: int
    seed: int
    without: tuple[str, ...] = ()
    group: str = ""  # sets of one group have the same truth
    hidden: str = ""  # what a whole camera has beside the usual effects

    @property
    def effects(self) -> Effects:
        return {name: EFFECTS[name].at(strength, self.camera_seed) for name, strength in self.strengths.items()}


def _stratified(count: int, low: float, rng: np.random.Generator) -> list[float]:
    """Strengths uniform in [low, 1], one in each of `count` equal parts."""
    return [float(s) for s in low + (1 - low) * (np.arange(count) + rng.random(count)) / max(count, 1)]


def draw_sets(plan: Plan) -> list[SetPlan]:
    """All sets of a plan, shuffled: a set's number tells nothing of its truth."""
    rng = stream(plan.seed, "plan", plan.name)
    low = plan.minimum_strength
    sets: list[SetPlan] = []

    def seed() -> int:
        return int(rng.integers(1, 2**31))

    def add(kind: str, strengths: dict[str, float], without: tuple[str, ...] = (), group: str = "") -> None:
        sets.append(SetPlan(kind, strengths, seed(), seed(), without, group))

    for _ in range(plan.nulls):
        add("null", {})
    for name in plan.single_effects or CATALOGUE:
        for strength in _stratified(plan.singles_each, low, rng):
            add("single", {name: strength})
    for name, strengths in plan.levels.items():
        camera_seed = seed()  # one camera: only the strength differs
        for strength in strengths:
            sets.append(SetPlan("level", {name: float(strength)}, camera_seed, seed()))
    names = list(CATALOGUE)
    for group, name in enumerate(rng.permutation(names)[: plan.replica_groups]):
        strength, camera_seed = float(rng.uniform(max(low, 0.3), 1)), seed()
        for _ in range(plan.replicas):
            sets.append(SetPlan("replica", {str(name): strength}, camera_seed, seed(), group=f"{group}:{name}"))
    for _ in range(plan.pairs):
        add("pair", {str(n): float(rng.uniform(low, 1)) for n in rng.choice(names, 2, replace=False)})
    for _ in range(plan.many):
        count = int(rng.integers(3, 7))
        add("many", {str(n): float(rng.uniform(low, 1)) for n in rng.choice(names, count, replace=False)})
    for name in plan.outside_effects or OUTSIDE:
        for strength in _stratified(plan.outside_each, low, rng):
            add("outside", {name: strength})
    for name in plan.without_effects or CATALOGUE:
        for strength in _stratified(plan.without_each, low, rng):
            add("without", {name: strength}, without=(name,))
    waiting: list[str] = []  # each effect is hidden once before one is hidden again
    for number in range(plan.whole):
        chosen = {str(rng.choice(choices)): float(rng.uniform(0, 0.5)) for choices in USUAL}
        hidden = ""
        if number % 2:
            if all(name in chosen for name in waiting):
                waiting += [str(name) for name in rng.permutation(names)]
            hidden = next(name for name in waiting if name not in chosen)
            waiting.remove(hidden)
            chosen[hidden] = float(rng.uniform(low, 1))
        sets.append(SetPlan("whole", chosen, seed(), seed(), hidden=hidden))
    return [sets[i] for i in rng.permutation(len(sets))]


def set_name(index: int) -> str:
    return f"s{index:04d}"


def readings_of(plan: Plan, entry: SetPlan) -> Readings:
    """How the set reads the catalogue's lines: as its camera's seed draws it, or as they are meant."""
    return draw_readings(stream(entry.camera_seed, "readings")) if plan.other_readings else AS_CATALOGUED


def camera_of(plan: Plan, entry: SetPlan) -> Camera:
    """The set's camera."""
    phasor = stream(entry.camera_seed, "baseline").random() < plan.unit_phasor_share
    return draw_camera(
        entry.camera_seed,
        plan.width,
        plan.height,
        "unit_phasor" if phasor else "circular_gaussian",
        plan.border_px,
        other=plan.other_cameras,
        readings=readings_of(plan, entry),
        conditions=draw_conditions(stream(entry.camera_seed, "conditions")) if entry.kind == "whole" else EVEN,
    )


def sequences_of(plan: Plan, entry: SetPlan) -> tuple[Sequence, ...]:
    """What is recorded: six sequences, further flats, and a second dark where the dark signal grows."""
    flats = (Sequence(f"flat_{i}", "flat", False, ms) for i, ms in enumerate(plan.flat_exposures_ms, 2))
    return (*SEQUENCES, *flats, *([LONG_DARK] if "dark_current" in entry.strengths else []))


def key(plan: Plan, entry: SetPlan) -> dict[str, Any]:
    """What the diagnosis never sees."""
    camera = camera_of(plan, entry)
    infos = [EFFECTS[name] for name in entry.strengths]
    return {
        "kind": entry.kind,
        "effects": on_camera(entry.effects, camera),
        "strength": entry.strengths,
        "hidden": entry.hidden,
        "conditions": {} if camera.conditions == EVEN else asdict(camera.conditions),
        "nuisance": camera.nuisance(),
        "in_catalogue": all(info.in_catalogue for info in infos),
        "without": list(entry.without),
        "group": entry.group,
        "stage": {info.id: info.stage for info in infos},
        "stages": sorted({stage for info in infos for stage in info.stages}),
        "sequences": sorted({name for info in infos for name in info.sequences}),
        "readings": {name: getattr(camera.readings, name) for name in entry.strengths if name in CHOICES},
        "frames": plan.frames,
        "seed": entry.seed,
        "camera_seed": entry.camera_seed,
    }


def write_drawn(folder: Path, plan: Plan, entry: SetPlan) -> None:
    """The capture set alone."""
    camera = camera_of(plan, entry)
    sequences = sequences_of(plan, entry)
    write_capture(folder, camera, on_camera(entry.effects, camera), plan.frames, entry.seed, sequences)


def write_plan(out: Path, plan: Plan) -> list[SetPlan]:
    """OUT/plan.json and all keys, OUT/keys/NAME.json. OUT may hold the same plan already, but no other."""
    text = json.dumps(asdict(plan), indent=1) + "\n"
    path = out / "plan.json"
    if path.is_file() and path.read_text() != text:
        raise ValueError(f"{out} holds another plan's sets; choose another folder, or remove them")
    (out / "keys").mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    sets = draw_sets(plan)
    for index, entry in enumerate(sets):
        (out / "keys" / f"{set_name(index)}.json").write_text(json.dumps(key(plan, entry), indent=1) + "\n")
    return sets
