"""The catalogue of benchmarks names programs and pages that exist; the pages name benchmarks of the catalogue."""

import re
import shlex

from benchmarks.__main__ import ROOT, catalogue


def test_programs_and_pages_of_the_catalogue_exist() -> None:
    for name, one in catalogue().items():
        assert one.keys() <= {"shows", "table", "takes", "run", "threads", "needs"}, name
        assert (ROOT / one["table"]).is_file(), name
        for program in one["run"]:
            assert (ROOT / shlex.split(program)[0]).is_file(), program


def test_documented_benchmarks_are_in_the_catalogue() -> None:
    pages = [*ROOT.glob("docs/**/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    named = {name for page in pages for name in re.findall(r"make bench-([\w-]+)", page.read_text(encoding="utf-8"))}
    assert len(named) > 20
    assert named <= catalogue().keys()
