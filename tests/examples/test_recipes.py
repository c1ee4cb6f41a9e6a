"""Recipes of pages for models of other programs, run as they are written."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.opensees import needs_opensees
from tests.support.snippets import code_blocks, run_cells
from updater import build_model, load_structure

PAGES = Path(__file__).parents[2] / "docs" / "howto" / "model"
S2K = """File portal.s2k was saved

TABLE:  "PROGRAM CONTROL"
   ProgramName=SAP2000   Version=14.0.0   ProgLevel=Advanced   CurrUnits="N, m, C"

TABLE:  "JOINT COORDINATES"
   Joint=1   CoordSys=GLOBAL   CoordType=Cartesian   XorR=0   Y=0   Z=0   SpecialJt=No
   Joint=2   CoordSys=GLOBAL   CoordType=Cartesian   XorR=0   Y=0   Z=2   SpecialJt=No

TABLE:  "CONNECTIVITY - FRAME"
   Frame=post   JointI=1   JointJ=2   IsCurved=No

TABLE:  "JOINT RESTRAINT ASSIGNMENTS"
   Joint=1   U1=Yes   U2=Yes   U3=Yes   R1=Yes   R2=Yes   R3=Yes

TABLE:  "MATERIAL PROPERTIES 02 - BASIC MECHANICAL PROPERTIES"
   Material="S 235"   UnitWeight=76972   UnitMass=7849   E1=210000000000   G12=80769230769 _
        U12=0.3   A1=0.0000117

TABLE:  "FRAME SECTION PROPERTIES 01 - GENERAL"
   SectionName=FLAT   Material="S 235"   Shape=Rectangular   t3=0.02   t2=0.06   Area=0.0012   TorsConst=1.2E-07 _
        I33=4E-08   I22=3.6E-07   AS2=0.001   AS3=0.001

TABLE:  "FRAME SECTION ASSIGNMENTS"
   Frame=post   SectionType=Rectangular   AutoSelect=N.A.   AnalSect=FLAT   MatProp=Default

END TABLE DATA
"""


def test_tables_of_sap2000_become_a_structure_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A slender cantilever bends about its weak axis first: beta L = 1.8751; shear costs under 0.1 %."""
    monkeypatch.chdir(tmp_path)
    Path("portal.s2k").write_text(S2K, encoding="utf-8")
    run_cells(code_blocks(PAGES / "sap2000.md"))
    model = build_model(load_structure("portal.toml"), shear_flexible=True, mass="consistent")
    expected = 1.875104**2 / (2 * np.pi * 4) * np.sqrt(210e9 * 4e-8 / (7849 * 0.0012))
    assert model.modes(1).frequency[0] == pytest.approx(expected, rel=1e-3)
    sway = model.modes(1).shape[model.dofs[-1, :2], 0]
    assert abs(sway[0]) > 100 * abs(sway[1])  # about axis 3, which is y for a vertical member


def test_tables_in_kips_and_inches_with_turned_axes_deflect_as_published(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CSI's SAP2000 verification example 1-004: cantilever W12X106 of 144 in, axis 2 turned by 30 degrees, 1 kip down.

    Deflections are published with five digits; the layout is that of a public test of a reader of $2k files.
    """
    monkeypatch.chdir(tmp_path)
    text = S2K.replace("N, m, C", "Kip, in, F").replace("XorR=0   Y=0   Z=2", "XorR=144   Y=0   Z=0")
    text = text.replace("=7849", "=0.000000735").replace("210000000000", "29000").replace("U12=0.3", "U12=0.3 ")
    text = text.replace("Area=0.0012   TorsConst=1.2E-07", "Area=31.2   TorsConst=9.13")
    text = text.replace("I33=4E-08   I22=3.6E-07   AS2=0.001   AS3=0.001", "I33=933   I22=301   AS2=0   AS3=0")
    turned = """TABLE:  "FRAME LOCAL AXES ASSIGNMENTS 1 - TYPICAL"
   Frame=post   Angle=30   MirrorAbt2=No   MirrorAbt3=No   AdvanceAxes=No

END"""
    Path("portal.s2k").write_text(text.replace("END", turned), encoding="utf-8", newline="\r\n")
    run_cells(code_blocks(PAGES / "sap2000.md"))
    model = build_model(load_structure("portal.toml"), shear_flexible=True, mass="consistent")
    force = np.zeros(model.stiffness.shape[0])
    force[model.dofs[-1, 2]] = -4448.2216  # N
    tip = np.linalg.solve(model.stiffness.toarray(), force)[model.dofs[-1, 1:3]] / 0.0254
    np.testing.assert_allclose(tip, [-0.03345, -0.05610], atol=6e-6)  # half of the last digit, and the rounded kip


@needs_opensees
def test_domain_of_opensees_becomes_a_structure_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plate is a cantilever strip: between the frequencies of a beam and of a plate in cylindrical bending."""
    monkeypatch.chdir(tmp_path)
    page = PAGES / "opensees.md"
    run_cells(code_blocks(page))
    toml = page.read_text(encoding="utf-8").partition("```toml\n")[2].partition("```")[0]
    sensor = '\n[[sensor]]\nchannel = "a"\nat = [0.75, 0.33, 0]\ndirection = [0, 0, 1]\n'
    Path("plate.toml").write_text('name = "plate"\n' + toml + sensor, encoding="utf-8")
    model = build_model(load_structure("plate.toml"), mass="consistent")
    beam = 1.875104**2 / (2 * np.pi * 0.8**2) * np.sqrt(70e9 * 0.008**2 / 12 / 2700)
    assert beam * 0.98 < model.modes(1).frequency[0] < beam / np.sqrt(1 - 0.33**2)
    assert model.sensor_rows[0].sum() != 0
    assert list(model.groups) == ["tip"]
