"""Places of a located mass in words: near a joint one place, named by it."""

import numpy as np

from monitor.results.convert import mass_answer
from monitor.text.causes import mass_text, member_share_text
from tests.support.updater.reference_frame import t_frame
from updater import MassChange
from updater.localization.one_mass import Alternative, BodyShape

FRAME = t_frame()
TOP = FRAME.member_named("column").length


def change_at(*alternatives: Alternative) -> MassChange:
    first = alternatives[0]
    return MassChange(
        member=first.member,
        distance=first.distance,
        distance_std=first.distance_std,
        mass=first.mass,
        mass_std=first.mass_std,
        body=BodyShape(offset=np.zeros(3), offset_std=np.ones(3), offset_known=False, inertia=0.0, inertia_known=False),
        alternatives=alternatives,
        region=(),
        member_probability=first.probability,
        p_value=0.5,
        model_error=0.01,
        tracks=np.arange(3),
        members=(),
        position=np.empty(0),
        density=np.empty(0),
        profile_mass=np.empty(0),
    )


def place(distance: float, probability: float, *others: str) -> Alternative:
    return Alternative(
        member="column",
        members=("column", *others),
        distance=distance,
        distance_std=0.003,
        mass=0.2,
        mass_std=0.007,
        probability=probability,
    )


def test_place_on_several_members_is_named_by_their_joint() -> None:
    answer = mass_answer(FRAME, change_at(place(TOP - 0.005, 0.99, "crossbeam")), 5, "")
    assert mass_text(answer).endswith("m ± 3 mm, at the joint of the column and the crossbeam")
    assert member_share_text(answer) == "99.0 % that it is at the joint of the column and the crossbeam"


def test_places_on_one_member_are_named_by_it() -> None:
    answer = mass_answer(FRAME, change_at(place(0.5, 0.7), place(TOP, 0.3, "crossbeam")), 5, "")
    first, second = mass_text(answer).split(" or ")
    assert first.endswith("m ± 3 mm")
    assert second.endswith("m ± 3 mm, at the joint of the column and the crossbeam (30.0 %)")
    assert member_share_text(answer) == "70.0 % that it is on the column"
