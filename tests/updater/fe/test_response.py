"""Ambient response against the closed forms of a damped oscillator under white noise."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import welch

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.frames import ALL, beam, clamped
from updater import Model, ModelError, Structure, build_model
from updater.fe import Ambient, AmbientResponse, Crack, Modes
from updater.fe.crack import ModalCrack
from updater.fe.response import _CrackedModes, _SlippingModes
from updater.structure import Joint, Segment, Support

TIP = (1.0, 0.0, 0.0)
DENSITY = 0.3
_ARM = 0.6  # m from the tip to a hinge
_COMPARED = 10  # modes
_LEFT_TOP, _RIGHT_TOP, _RIGHT_FOOT = (0.0, 0.0, 1.0), (1.2, 0.0, 1.0), (1.2, 0.0, 0.0)
_IN_BEAM = Crack(member="beam", distance=0.3, axis="y", flexibility=0.2, closed=0.02)
_IN_FOOT = Crack(member="left", distance=0.0, axis="y", flexibility=0.2, closed=0.02)
_FAINT = 1e-12  # of that density: moments far below 1e-3 N m


def _bar() -> Structure:
    """One element that can only stretch: a single mass of 0.5 on a spring of 4."""
    held = ALL[1:]
    structure = beam(length=1.0, elements=1, support=clamped(), modulus=4.0)
    return structure.model_copy(update={"support": (*structure.support, Support(at=TIP, fixed=held))})


def _response(model: Model, damping: FloatArray, rate: float, seed: int, density: float = DENSITY) -> AmbientResponse:
    ambient = Ambient(points=(TIP,), axes=(0,), density=density)
    return AmbientResponse(model, model.read(np.array(TIP))[:1], damping, ambient, rate=rate, seed=seed)


@pytest.mark.parametrize("seed", few_of([1, 2, 3]))
def test_oscillator_spectrum_and_variance_match_closed_forms(seed: int) -> None:
    """Displacement variance pi S0 / (2 zeta omega^3 m^2), S0 = density / 2 pi (Crandall & Mark 1963, s. 2.2)."""
    model, zeta, rate = build_model(_bar()), 0.05, 20.0
    omega = float(model.modes(1).omega[0])
    assert omega == pytest.approx(np.sqrt(4 / 0.5))
    n = 400_000
    acceleration = _response(model, np.array([zeta]), rate, seed).step(n)[:, 0]
    frequency, power = welch(acceleration, rate, nperseg=4096)
    w = 2 * np.pi * frequency
    theory = 2 * DENSITY / 0.25 * np.abs(w**2 / (omega**2 - w**2 + 2j * zeta * omega * w)) ** 2
    band = np.abs(w / omega - 1) < 0.4
    # 195 half-overlapping segments: power is right to about 1 / sqrt(100 segments x 10 bins in a resonance's width)
    assert power[band].sum() / theory[band].sum() == pytest.approx(1, abs=5 / np.sqrt(1000))
    # S_displacement = S_acceleration / omega^4; tails beyond a decade hold 0.1 %
    step, part = frequency[1], (w > 0.1 * omega) & (w < 2.5 * omega)
    variance = (power[part] / w[part] ** 4).sum() * step
    exact = np.pi * (DENSITY / (2 * np.pi)) / (2 * zeta * omega**3) / 0.25
    assert (theory[part] / w[part] ** 4).sum() * step == pytest.approx(exact, rel=0.05)
    # a record of T holds 2 pi zeta f T / ... independent energies: relative deviation 1 / sqrt(zeta omega T)
    assert variance == pytest.approx(exact, rel=0.05 + 4 / np.sqrt(zeta * omega * n / rate))


def test_response_does_not_depend_on_chunk_lengths() -> None:
    model = build_model(beam(length=1.0, elements=3, support=clamped(), second_moment=(0.01, 0.02)), mass="consistent")
    damping = np.full(4, 0.02)
    whole = _response(model, damping, 50.0, 7).step(1000)
    other = _response(model, damping, 50.0, 7)
    pieces = np.concatenate([other.step(n) for n in (1, 299, 700)])
    np.testing.assert_allclose(pieces, whole, rtol=0, atol=1e-12 * np.abs(whole).max())


def test_seeds_give_different_forces() -> None:
    model = build_model(_bar())
    first, second = (_response(model, np.array([0.02]), 20.0, seed).step(50) for seed in (1, 2))
    assert np.abs(first - second).max() > 0.1 * np.abs(first).max()


def _two_models() -> tuple[Model, Model]:
    light = beam(length=1.0, elements=2, support=clamped(), second_moment=(0.01, 0.02), torsion_constant=0.01)
    heavy = light.model_copy(
        update={"material": {"m": light.material["m"].model_copy(update={"density": 3.0, "youngs_modulus": 1.5})}}
    )
    return build_model(light, mass="consistent"), build_model(heavy, mass="consistent")


def test_model_change_keeps_displacement_and_velocity() -> None:
    """In all modes: to another model and back, without a step between, is as if nothing had happened."""
    light, heavy = _two_models()
    damping = np.full(light.n_dofs, 0.02)
    plain, changed = (_response(light, damping, 20.0, 5) for _ in range(2))
    np.testing.assert_array_equal(plain.step(200), changed.step(200))
    changed.change(heavy)
    changed.change(light)
    expected = plain.step(200)
    np.testing.assert_allclose(changed.step(200), expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_response_after_a_model_change_has_the_new_resonance() -> None:
    """Long after the change the response is the new model's: its lowest resonance, not the old one's."""
    light, heavy = _two_models()
    response = _response(light, np.full(light.n_dofs, 0.05), 20.0, 5)
    response.step(1000)
    response.change(heavy)
    response.step(5000)
    frequency, power = welch(response.step(100_000)[:, 0], 20.0, nperseg=4096)
    axial = np.sqrt(1.5 / 3.0) / 4  # of the changed rod; of the old one 1/4 Hz
    low = frequency < 0.4
    assert frequency[low][np.argmax(power[low])] == pytest.approx(axial, rel=0.05)


def test_crack_that_is_as_soft_closed_as_open_is_a_softer_structure() -> None:
    """The frequencies are those of a hinge with the same flexibility between two members."""
    crack = Crack(member="b", distance=0.4, axis="y", flexibility=0.06, closed=0.06)
    _check_peaks(_thin_cantilever(), crack, 0.06, 0.4)


@pytest.mark.parametrize(
    ("moment", "flexibility", "opens"),
    few_of([(1e-3, 0.0, "above"), (-1e-3, 0.06, "below"), (-1e-3, 0.06, "above"), (1e-3, 0.0, "below")], 2),
)
def test_crack_of_a_file_is_open_on_its_side_of_the_moment(
    moment: float, flexibility: float, opens: Literal["above", "below"]
) -> None:
    """The mean is in a segment of the file: frequencies beyond all moments are those of the open or closed hinge."""
    segment = {"member": "b", "at": (0.4, 0.0, 0.0), "extent": 0.05, "bending": (1 / 1.6, 1.0)}
    crack = {"member": "b", "at": (0.4, 0.0, 0.0), "axis": "y", "flexibility": 0.06, "mean": 0.03, "opens": opens}
    crack["moment"] = moment if opens == "above" else -moment
    content = _thin_cantilever().model_dump(by_alias=True) | {"segment": [segment], "breathing_crack": [crack]}
    structure = Structure.model_validate(content)
    found = Crack.of(structure)
    assert found
    _check_peaks(structure, found, flexibility, 0.4)
    twice = structure.model_copy(update={"breathing_crack": 2 * structure.breathing_crack})
    with pytest.raises(ModelError, match="at most one in a simulation, found 2"):
        Crack.of(twice)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("opens", "moment", "flexibility"),
    [("within", 1e3, 0.06), ("within", 1e-9, 0.0), ("beyond", 1e3, 0.0), ("beyond", 1e-9, 0.06)],
)
def test_play_is_open_within_its_moment_on_both_sides(
    opens: Literal["within", "beyond"], moment: float, flexibility: float
) -> None:
    """Far below and far above the moment, frequencies are those of a linear hinge, open or closed."""
    crack = Crack(member="b", distance=0.4, axis="y", flexibility=0.06, opens=opens, moment=moment)
    _check_peaks(_thin_cantilever(), crack, flexibility, 0.4)


@pytest.mark.parametrize("opens", ["within", "beyond"])
def test_play_under_a_slow_force_has_the_rotation_of_its_law(opens: Literal["within", "beyond"]) -> None:
    """A cantilever under a tip force that rises slowly: the deflection over the force is piecewise linear."""
    crack = Crack(member="b", distance=0.4, axis="y", flexibility=0.06, opens=opens, moment=0.3)
    moment = _ARM * np.linspace(-1.0, 1.0, 4000)
    excess = np.sign(moment) * np.maximum(np.abs(moment) - crack.moment, 0.0)
    _check_slow_deflection(crack, moment, 0.06 * (excess if opens == "beyond" else moment - excess))


def test_dry_friction_under_a_slow_force_has_the_loop_of_its_law() -> None:
    """Up, down and up again: it sticks from each end until the moment has changed by twice the slip moment."""
    crack = Crack(member="b", distance=0.4, axis="y", flexibility=0.06, closed=0.02, opens="slips", moment=0.2)
    rise = np.linspace(-1.0, 1.0, 4000)
    moment = _ARM * np.concatenate([rise[2000:], -rise, rise])
    slider = [0.0]
    for m in moment:
        slider.append(max(m - crack.moment, min(m + crack.moment, slider[-1])))
    _check_slow_deflection(crack, moment, 0.02 * moment + 0.04 * np.array(slider[1:]))


def test_model_change_keeps_a_place_where_it_stuck_or_slid() -> None:
    """At any sample: a change to the same model is no change. Without the slider's place, it is one."""
    model, damping = build_model(_thin_cantilever(), mass="consistent"), np.full(8, 0.01)
    crack = Crack(member="b", distance=0.4, axis="y", flexibility=0.06, opens="slips", moment=2e-7)
    ambient = Ambient(points=(TIP,), axes=(2,), density=_FAINT * DENSITY)
    rows = model.read(np.array(TIP))[2:3]
    plain, changed, forgetful = (AmbientResponse(model, rows, damping, ambient, rate=0.4, seed=5) for _ in range(3))
    for response in (plain, changed, forgetful):
        response.change(model, crack)
    expected = plain.step(400)
    for k in range(0, 400, 20):
        found = changed.step(20)
        np.testing.assert_allclose(found, expected[k : k + 20], rtol=0, atol=1e-7 * np.abs(expected).max())
        changed.change(model, crack)
    forgetful.step(200)
    forgetful.change(model)
    forgetful.change(model, crack)
    assert np.abs(forgetful.step(200) - expected[200:]).max() > 0.01 * np.abs(expected).max()


@pytest.mark.parametrize("feet", [1, 2])
@pytest.mark.parametrize("crack", [_IN_BEAM, _IN_FOOT], ids=["beam", "foot"])
def test_hinge_has_the_frequencies_of_a_rotational_spring(crack: Crack, feet: int) -> None:
    """Closed and open, in a portal with one clamped foot and with two, which is statically indeterminate.

    The truth has the spring as a joint between two parts of the beam, or below the foot. With the flexibility of a
    determinate structure, frequencies of the indeterminate one would be up to 0.9 % too low with the hinge in the beam,
    and 3.7 % with that in the foot. The remaining errors, 0.018 % of the tenth mode, are of the inertia of elements.
    """
    for at_rest, with_spring in zip(_frequencies(crack, _portal(feet)), _springs(crack, feet), strict=True):
        np.testing.assert_allclose(at_rest, with_spring, rtol=2e-4)


@pytest.mark.parametrize("feet", [1, 2])
def test_hinge_of_a_mean_spring_takes_it_back(feet: int) -> None:
    """The model has the mean flexibility as a spring below the foot; the crack is closed, and open."""
    mean = replace(_IN_FOOT, closed=0.06, flexibility=0.06)
    crack = replace(_IN_FOOT, mean=0.06)
    for at_rest, with_spring in zip(_frequencies(crack, _with_spring(mean, feet)), _springs(crack, feet), strict=True):
        np.testing.assert_allclose(at_rest, with_spring, rtol=2e-4)


def test_hinge_of_a_softer_segment_takes_it_back() -> None:
    """The segment of 50 mm has three times its flexibility; the truths have none, and five times."""
    crack = replace(_IN_BEAM, closed=0.0, flexibility=0.2, mean=0.1)
    found = _frequencies(crack, _with_segment(0.1))
    for at_rest, truth in zip(found, (_portal(2), _with_segment(0.2)), strict=True):
        np.testing.assert_allclose(at_rest, _modes(truth).frequency[:_COMPARED], rtol=2e-4)


def test_crack_without_its_mean_flexibility_in_the_file_is_refused() -> None:
    structure = _with_segment(0.02)
    with pytest.raises(ModelError, match=r"breathing_crack of beam: expected more than 0.1 m .*, found 0.07 m"):
        _frequencies(replace(_IN_BEAM, closed=0.0, mean=0.1), structure)
    with pytest.raises(ModelError, match=r"expected more than 0.01 m .*, found 0 m"):  # it is not in a sound member
        _frequencies(replace(_IN_BEAM, closed=0.0, mean=0.01), _portal(2))


def _portal(feet: int) -> Structure:
    """Return a portal of two posts and a beam, of 17 to 20 mm elements, on one or two clamped feet."""
    tube = {"material": "m", "section": "s", "local_y": (0.0, 1.0, 0.0), "elements": 60}
    ends = {"beam": (_LEFT_TOP, _RIGHT_TOP), "left": ((0.0, 0.0, 0.0), _LEFT_TOP), "right": (_RIGHT_FOOT, _RIGHT_TOP)}
    members = [{"name": name, "from": start, "to": end, **tube} for name, (start, end) in ends.items()]
    content = beam(
        length=1.0, elements=1, support=clamped(), area=0.02, second_moment=(1e-6, 2e-6), torsion_constant=2e-6
    ).model_dump()
    supports = [{"at": at, "fixed": ALL} for at in ((0.0, 0.0, 0.0), _RIGHT_FOOT)[:feet]]
    return Structure.model_validate(content | {"member": members, "support": supports})


def _with_spring(crack: Crack, feet: int) -> Structure:
    """Return the portal with the open crack as a rotational spring."""
    structure = _portal(feet)
    spring = structure.rigidity(structure.member[0])[1] / crack.flexibility
    if crack.member == "left":
        foot = Support(at=(0.0, 0.0, 0.0), fixed=tuple(axis for axis in ALL if axis != "ry"), stiffness={"ry": spring})
        return structure.model_copy(update={"support": (foot, *structure.support[1:])})
    whole, *others = structure.member
    at = (crack.distance, 0.0, 1.0)
    parts = [
        whole.model_copy(update={"name": name, "start": start, "end": end, "elements": elements})
        for name, start, end, elements in (("beam", _LEFT_TOP, at, 15), ("rest", at, _RIGHT_TOP, 45))
    ]
    joint = Joint(member="rest", at=at, stiffness={"ry": spring})
    return structure.model_copy(update={"member": (*parts, *others), "joint": (joint,)})


def _springs(crack: Crack, feet: int) -> list[FloatArray]:
    """Return the frequencies of the portal with the spring of the closed crack, and with that of the open one."""
    sides = (replace(crack, flexibility=flexibility) for flexibility in (crack.closed, crack.flexibility))
    return [_modes(_with_spring(side, feet)).frequency[:_COMPARED] for side in sides]


def _with_segment(flexibility: float) -> Structure:
    """Return the portal on two feet with a softer stretch of 50 mm in its beam."""
    factor = 0.05 / (0.05 + flexibility)
    segment = Segment(member="beam", at=(_IN_BEAM.distance, 0.0, 1.0), extent=0.05, bending=(factor, 1.0))
    return _portal(2).model_copy(update={"segment": (segment,)})


def _modes(structure: Structure) -> Modes:
    return build_model(structure, shear_flexible=True, mass="consistent").modes(_COMPARED + 6)


def _frequencies(crack: Crack, structure: Structure) -> list[FloatArray]:
    """Return the frequencies in modes of a structure with a crack that is closed, and open."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modal = ModalCrack.of(crack, model, model.modes(_COMPARED + 6))
    n = len(modal.modes.omega)
    sides = _CrackedModes(modal, np.full(n - 1, 0.01), 1.0)._sides
    return [np.sqrt(np.linalg.eigvalsh(-rates[:, :n])[:_COMPARED]) / (2 * np.pi) for _, rates, _ in sides]


def _check_slow_deflection(crack: Crack, moment: FloatArray, rotation: FloatArray) -> None:
    """Compare the tip's deflection under a slow force with that of a hinge, given over E I, from 20 periods on."""
    model = build_model(_thin_cantilever(), mass="consistent")
    modal = ModalCrack.of(crack, model, model.modes(8))
    modes, damping = modal.modes, np.full(9, 0.7)
    rate = 20 * float(modes.omega[0]) / (2 * np.pi)
    coupled = _SlippingModes if crack.opens == "slips" else _CrackedModes
    own = coupled(modal, damping[:8], rate)
    at_tip = model.read(np.array(TIP))[2] @ modes.shape
    pole = -damping * modes.omega + 1j * modes.omega * np.sqrt(1 - damping**2)
    force, state, found = moment / _ARM, np.zeros(9, complex), []
    for part in np.array_split(force, len(force) // 100):
        _, state = own.run(state, pole, part[:, None] * at_tip)
        found.append(float(at_tip @ (state.imag / pole.imag)))
    kept = np.arange(99, len(force), 100)[4:]
    hinge = rotation[kept] / model.structure.rigidity(model.structure.member[0])[1]
    expected = at_tip @ (at_tip / modes.omega**2) * force[kept] + _ARM * hinge
    # of a force at a rate, the first mode is late by 2 zeta / omega
    lag = float(np.abs(np.diff(force)).max()) * rate * 2 * 0.7 / float(modes.omega[0]) * float(np.abs(found).max())
    np.testing.assert_allclose(found[4:], expected, atol=3 * lag)


@pytest.mark.parametrize("opens", ["within", "beyond"])
def test_sample_that_passes_the_play_is_divided_twice(opens: Literal["within", "beyond"]) -> None:
    """A free vibration that passes both moments within one sample; and with samples of 1/64, none of which does.

    Undivided within the play, the state would be off by 0.5 %. Each division is off by 1/32 of the sample at most, the
    play takes 0.45 of it: 2 / 32 / 0.45 of 0.5 % is 0.07 %.
    """
    model = build_model(_thin_cantilever(), mass="consistent")
    modes, damping = model.modes(1), np.array([0.01])
    crack = Crack(member="b", distance=0.4, axis="y", flexibility=0.06, opens=opens, moment=0.1)
    whole = ModalCrack.of(crack, model, modes)
    rest = float(whole.action[1] / whole.modes.omega[1])  # root of the flexibility of the residual shape
    modal = replace(whole, modes=modes, action=whole.action[:1], stiffness=whole.stiffness - rest**2)
    pole = -damping * modes.omega + 1j * modes.omega * np.sqrt(1 - damping**2)
    (moment,), reached = modal.action, modal.opens
    q, dq = 1.5 * reached / moment, -4 * reached / moment * modes.omega
    start, found = dq - pole.real * q + 1j * pole.imag * q, []
    for parts in (1, 64):
        own = _CrackedModes(modal, damping, parts * 6 * float(modes.omega[0]) / (2 * np.pi))
        found.append(own.run(start, pole, np.zeros((parts, 1)))[1])
    assert moment * found[0].imag / pole.imag < -reached
    np.testing.assert_allclose(found[0], found[1], rtol=1e-3)


def _thin_cantilever() -> Structure:
    return beam(length=1.0, elements=20, support=clamped(), second_moment=(1e-4, 2e-4), torsion_constant=1e-4)


def _check_peaks(structure: Structure, crack: Crack, flexibility: float, at: float) -> None:
    """Compare the peaks of a cracked cantilever's response with the frequencies of one with a hinge."""
    rate, n = 0.4, 200_000
    model, damping = build_model(structure, mass="consistent"), np.full(8, 0.002)
    ambient = Ambient(points=(TIP,), axes=(2,), density=_FAINT * DENSITY)
    response = AmbientResponse(model, model.read(np.array(TIP))[2:3], damping, ambient, rate=rate, seed=5)
    response.change(model, crack)
    acceleration = response.step(n)[:, 0]
    frequency, power = welch(acceleration, rate, nperseg=1 << 16)
    hinged = _hinged_cantilever(flexibility, at)
    healthy = _hinged_cantilever(0.0, at)
    for softer, before in zip(hinged, healthy, strict=True):
        near = np.abs(frequency / before - 1) < 0.2
        peak = frequency[near][np.argmax(power[near])]
        # a record of T determines a frequency to sqrt(zeta / (2 pi f T)) of it; a line is 0.1 % of the first
        noise = np.sqrt(0.002 / (2 * np.pi * before * n / rate))
        assert peak == pytest.approx(softer, rel=4 * noise + 0.002)
        assert flexibility == 0 or abs(softer / before - 1) > 0.01


def _hinged_cantilever(flexibility: float, at: float) -> FloatArray:
    """Return two frequencies of a cantilever with a rotational spring, from the beam equation in two parts [Hz].

    Rigidity E I of 1e-4, unit length and unit mass per length.
    """

    def determinant(beta: float) -> float:
        # the clamped part: A (cosh - cos) + B (sinh - sin); beyond the spring with jump (sin + sinh) / (2 beta) added
        def parts(x: float) -> FloatArray:
            c, s, ch, sh = np.cos(beta * x), np.sin(beta * x), np.cosh(beta * x), np.sinh(beta * x)
            moment, shear = beta**2 * np.array([ch + c, sh + s]), beta**3 * np.array([sh - s, ch + c])
            return np.array([moment, shear])

        jump = flexibility * parts(at)[0]
        rest = beta * (1.0 - at)
        moment = beta / 2 * (np.sinh(rest) - np.sin(rest))
        shear = beta**2 / 2 * (np.cosh(rest) - np.cos(rest))
        return float(np.linalg.det(parts(1.0) + np.outer([moment, shear], jump)))

    betas = np.linspace(1.0, 6.0, 2001)
    values = np.array([determinant(b) for b in betas])
    roots = [brentq(determinant, betas[k], betas[k + 1]) for k in np.flatnonzero(values[1:] * values[:-1] < 0)[:2]]
    return np.asarray(np.square(roots) * np.sqrt(1e-4) / (2 * np.pi))
