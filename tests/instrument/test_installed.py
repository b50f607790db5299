"""Instruments of installed packages: an entry point names a package, and each protocol file in its folder is one."""

from __future__ import annotations

import sys

import pytest

from dbbstation.errors import InputError
from dbbstation.instrument.library import instruments_folder, known_instruments, load_instrument

SHIPPED = "heidenhain-nd287"


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package with a protocol file of this name; its entry point is given."""

    def installed(name, entry="shop_gauges"):
        about = tmp_path / "shop_gauges-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: shop-gauges\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(f"[dbbstation.instruments]\nshop = {entry}\n")
        package = tmp_path / "shop_gauges"
        package.mkdir()
        (package / "__init__.py").write_text("")
        text = (instruments_folder() / f"{SHIPPED}.yaml").read_text(encoding="utf-8")
        (package / f"{name}.yaml").write_text(text.replace(f"name: {SHIPPED}", f"name: {name}"), encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "shop_gauges", raising=False)

    return installed


def test_an_installed_instrument_is_known_and_read_by_its_name(install):
    before = set(known_instruments())
    install("shop-gauge")
    assert set(known_instruments()) - before == {"shop-gauge"}
    assert load_instrument("shop-gauge").name == "shop-gauge"
    assert load_instrument("shop-gauge").line == load_instrument(SHIPPED).line


def test_a_name_that_is_taken_names_package_and_owner(install):
    install(SHIPPED)
    what = f"entry point shop of the package shop-gauges: an instrument `{SHIPPED}` is known already, from dbbstation itself"
    with pytest.raises(InputError, match=what):
        known_instruments()


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ("no_such_package", "cannot be loaded: ModuleNotFoundError"),
        ("json.decoder", "json.decoder is no package with a file that ends in .yaml"),
        ("email", "email is no package with a file that ends in .yaml"),
    ],
)
def test_an_entry_point_that_does_not_hold_names_its_package(install, entry, why):
    install("shop-gauge", entry)
    with pytest.raises(InputError) as refused:
        load_instrument(SHIPPED)
    assert str(refused.value).startswith(f"entry point shop of the package shop-gauges: {why}")
    assert str(refused.value).endswith("mend or uninstall the package shop-gauges")
