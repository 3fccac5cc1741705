"""Corridors full of simulated people, before and after an edit of the layout: JuPedSim, by three of its models.

The same people come at the same instants before and after: what differs is the edit. They walk to a strip of the other
end, and are seen between the two ends only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import pandas as pd
import shapely

LENGTH_M: Final = 30.0
VIEW_M: Final = (4.0, 26.0)
"""Part of the corridor that the camera sees: people enter and leave outside it."""
OPEN_S: Final = 1800
"""Seconds in which people come to a corridor."""
DOOR_X_M: Final = 20.0
"""A wall with a door stands here in scenes with one."""
STEP_S: Final = {"speed": 0.05, "force": 0.01, "warp": 0.02}
"""Models by name, with the time step that each needs: collision-free speed, social force, Warp Driver."""
STRIPS: Final = 6
_APART_M: Final = 0.8
"""Nobody enters closer to somebody else than this."""
_LONGEST_S: Final = OPEN_S + 900
Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Scene:
    """A corridor and an edit of it.

    Attributes:
        kind: What is edited: "fixture", "moved", "null", "queue", "no queue", "both ways", "wider".
        model: A key of `STEP_S`.
        seed: Of its people.
        width_m: Of the corridor.
        people_per_s: Who come to it, both ends together.
        back_share: Share of them who come from the right.
        n_people: They come until there are so many; None = for `OPEN_S`.
        old_box, new_box: The fixture, (x0, y0, x1, y1); None = there is none.
        old_door_m, new_door_m: Clear width of the door at `DOOR_X_M`; None = there is none.
    """

    kind: str
    model: str
    seed: int
    width_m: float
    people_per_s: float
    back_share: float = 0.0
    n_people: int | None = None
    old_box: Box | None = None
    new_box: Box | None = None
    old_door_m: float | None = None
    new_door_m: float | None = None


def scenes(first_seed: int) -> Iterator[Scene]:
    """Yield 54 scenes of all kinds; widths, demand, sizes and places of fixtures are drawn by their seeds."""
    seed = first_seed
    for model in STEP_S:
        for kind, n in (("fixture", 8), ("moved", 2), ("null", 1)):
            for k in range(n):
                yield _with_fixture(kind, model, seed, both_ways=k % 2 == 1)
                seed += 1
        for kind in ("queue", "queue", "no queue", "both ways", "wider", "wider"):
            yield _with_door(kind, model, seed)
            seed += 1
        yield _with_fixture("null", model, seed, both_ways=True)
        seed += 1


def _with_fixture(kind: str, model: str, seed: int, *, both_ways: bool) -> Scene:
    draw = np.random.default_rng(seed)
    width_m = float(draw.choice([3.0, 4.0, 5.0, 6.0]))
    flow = width_m * float(draw.uniform(0.02, 0.12))
    long_m, deep_m = draw.uniform(0.8, 3.0), draw.uniform(0.6, width_m / 2.5)
    y0 = draw.uniform(0.0, width_m - deep_m)
    y0 = 0.0 if y0 < 1.0 else width_m - deep_m if width_m - deep_m - y0 < 1.0 else y0
    new = (14.0, y0, 14.0 + long_m, y0 + deep_m)
    old = None
    if kind == "moved":
        shift_m = draw.uniform(-6.0, 6.0)
        old = (new[0] + shift_m, width_m - new[3], new[2] + shift_m, width_m - new[1])
        if shapely.box(*old).distance(shapely.box(*new)) < 1.0:
            old = (new[0] - 5.0, old[1], new[2] - 5.0, old[3])
    if kind == "null":
        new = (14.0, width_m + 2.6, 15.0, width_m + 3.6)  # in a bay that nobody walks through
    share = float(draw.uniform(0.3, 0.5)) if both_ways else 0.0
    return Scene(kind, model, seed, width_m, flow, share, old_box=old, new_box=new)


def _with_door(kind: str, model: str, seed: int) -> Scene:
    draw = np.random.default_rng(seed)
    old_m = float(draw.uniform(1.8, 3.0))
    new_m = float(draw.uniform(1.0, 0.75 * old_m))
    if kind == "wider":
        old_m, new_m = new_m, old_m
    if kind in ("queue", "wider"):
        n, flow = int(draw.integers(250, 400)), 8.0
        return Scene(kind, model, seed, 6.0, flow, n_people=n, old_door_m=old_m, new_door_m=new_m)
    share = 0.4 if kind == "both ways" else 0.0
    return Scene(kind, model, seed, 6.0, 0.3, share, old_door_m=old_m, new_door_m=new_m)


def walked(scene: Scene, *, after: bool) -> tuple[pd.DataFrame, int]:
    """Return who is where each second (`t_s`, `track_id`, `x_m`, `y_m`), and how many never arrived.

    Args:
        scene: The scene.
        after: With the edit.
    """
    import jupedsim as jps

    floor = _floor(scene, after=after)
    model = {
        "speed": jps.CollisionFreeSpeedModel, "force": jps.SocialForceModel, "warp": jps.WarpDriverModel
    }[scene.model]()  # fmt: skip
    simulation: Any = jps.Simulation(model=model, geometry=floor, dt=STEP_S[scene.model])
    crowd = _Crowd(scene, simulation, jps)
    every = round(1 / STEP_S[scene.model])
    rows: list[tuple[float, int, float, float]] = []
    steps = 0
    while crowd.waits or simulation.agent_count():
        if steps % every == 0:
            at_s = steps // every
            if at_s > _LONGEST_S:
                break
            rows += [(at_s, agent.id, *agent.position) for agent in simulation.agents()]
        if steps % (every // 5) == 0:
            crowd.enter(steps / every)
        simulation.iterate()
        steps += 1
    seen = pd.DataFrame(rows, columns=["t_s", "track_id", "x_m", "y_m"])
    seen = seen[(seen["x_m"] >= VIEW_M[0]) & (seen["x_m"] <= VIEW_M[1])]
    return seen, simulation.agent_count() + crowd.waits


def _floor(scene: Scene, *, after: bool) -> shapely.Polygon:
    """Return where people can walk; scenes without an effect have a bay beside the way."""
    width_m = scene.width_m
    floor: shapely.Geometry = shapely.box(0, 0, LENGTH_M, width_m)
    if scene.kind == "null":
        floor = floor.union(shapely.box(12, width_m, 17, width_m + 4))
    box, door_m = (scene.new_box, scene.new_door_m) if after else (scene.old_box, scene.old_door_m)
    if box is not None:
        floor = floor.difference(shapely.box(*box))
    if door_m is not None:
        for y in ((-1.0, (width_m - door_m) / 2), ((width_m + door_m) / 2, width_m + 1)):
            floor = floor.difference(shapely.box(DOOR_X_M, y[0], DOOR_X_M + 0.2, y[1]))
    assert isinstance(floor, shapely.Polygon)
    return floor


@dataclass(slots=True)
class _Crowd:
    """The people who come: who waits at which end, and enters where there is room."""

    scene: Scene
    simulation: Any
    jps: Any
    queues: tuple[list[Any], list[Any]] = field(default_factory=lambda: ([], []))

    def __post_init__(self) -> None:
        scene, width_m = self.scene, self.scene.width_m
        draw = np.random.default_rng(scene.seed + 1_000_000)
        n = scene.n_people or draw.poisson(scene.people_per_s * OPEN_S)
        come_s = np.cumsum(draw.exponential(1 / scene.people_per_s, n))
        strips = [[self._strip(end, k) for k in range(STRIPS)] for end in (LENGTH_M - 1.3, 0.1)]
        for at_s in come_s:
            side = int(draw.random() < scene.back_share)
            y, speed = draw.uniform(0.4, width_m - 0.4), float(np.clip(draw.normal(1.3, 0.2), 0.7, 1.9))
            self.queues[side].append((at_s, y, speed, strips[side][draw.integers(STRIPS)]))

    @property
    def waits(self) -> int:
        return len(self.queues[0]) + len(self.queues[1])

    def enter(self, now_s: float) -> None:
        """Let those enter whose time has come and who find room."""
        for side, x in ((0, 2.5), (1, LENGTH_M - 2.5)):
            waiting = self.queues[side]
            if not waiting or waiting[0][0] > now_s:
                continue
            there = [p.position for p in self.simulation.agents() if abs(p.position[0] - x) < _APART_M]
            stay = []
            for k, person in enumerate(waiting):
                at_s, y, speed, (stage, journey) = person
                if at_s > now_s:
                    stay += waiting[k:]
                    break
                if any((x - px) ** 2 + (y - py) ** 2 < _APART_M**2 for px, py in there):
                    stay.append(person)
                    continue
                self.simulation.add_agent(self._agent(x, y, speed, stage, journey))
                there.append((x, y))
            self.queues[side][:] = stay

    def _strip(self, x: float, k: int) -> tuple[int, int]:
        """Return stage and journey of a strip of an end."""
        low, high = self.scene.width_m * k / STRIPS + 0.1, self.scene.width_m * (k + 1) / STRIPS - 0.1
        stage = self.simulation.add_exit_stage([(x, low), (x + 1.2, low), (x + 1.2, high), (x, high)])
        return stage, self.simulation.add_journey(self.jps.JourneyDescription([stage]))

    def _agent(self, x: float, y: float, speed: float, stage: int, journey: int) -> Any:
        kind = {
            "speed": self.jps.CollisionFreeSpeedModelAgentParameters,
            "force": self.jps.SocialForceModelAgentParameters,
            "warp": self.jps.WarpDriverModelAgentParameters,
        }[self.scene.model]
        return kind(position=(x, y), desired_speed=speed, radius=0.2, journey_id=journey, stage_id=stage)
