"""Boxes by name: this package's own, and those that other packages add by entry points."""

from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from types import SimpleNamespace
from typing import Any

import pytest

from semrl.core import registry
from semrl.core.errors import UsageError
from semrl.core.registry import Registry


@dataclass(frozen=True, kw_only=True)
class OwnConfig:
    sides: int = 6


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Of the owner of the registry: a part for each box of its own, options for those of others."""

    die: OwnConfig = field(default_factory=OwnConfig)
    options: dict[str, dict[str, Any]] = field(default_factory=dict)


class Die:
    def __init__(self, config: OwnConfig, *, seed: int = 0) -> None:
        self.config = config
        self.seed = seed


class Coin:
    """As another package would write it."""

    @dataclass(frozen=True, kw_only=True)
    class Config:
        weight: float = 0.5
        names: tuple[str, ...] = ("heads", "tails")

        def __post_init__(self) -> None:
            if not 0 <= self.weight <= 1:
                raise UsageError(f"weight lies between 0 and 1, not {self.weight}")

    def __init__(self, config: Config, *, seed: int = 0) -> None:
        self.config = config
        self.seed = seed


class Bare:
    """Has no parameters, and forgot to say so."""


ADDED = {
    "coin": f"{__name__}:Coin",
    "die": f"{__name__}:Coin",  # this package's own of that name comes first
    "gone": "no_such_module_of_anyone:Thing",
    "lacking": f"{__name__}:Missing",
    "bare": f"{__name__}:Bare",
    "broken": "broken_box:Box",
}


@pytest.fixture
def dice(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> Any:
    """A registry to which other packages have added theirs."""
    (tmp_path / "broken_box.py").write_text("raise RuntimeError('this package\\nneeds a licence')\n")
    monkeypatch.syspath_prepend(tmp_path)
    points = [EntryPoint(name, value, "semrl.dice") for name, value in ADDED.items()]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == "semrl.dice" else [])
    registry._added.cache_clear()
    yield Registry[Any]("dice", {"die": f"{__name__}:Die"})
    registry._added.cache_clear()


def test_own_names_come_first_and_each_once(dice: Any) -> None:
    assert dice.names() == ("die", "coin", "gone", "lacking", "bare", "broken")
    assert Registry[Any]("cards", {"ace": "x:Ace"}).names() == ("ace",)


def test_a_box_is_made_with_its_own_part_of_the_configuration(dice: Any) -> None:
    die = dice.make("die", Settings(die=OwnConfig(sides=20)), seed=7)
    assert type(die).__name__ == "Die" and die.config.sides == 20 and die.seed == 7


def test_a_box_of_another_package_takes_its_parameters_from_options(dice: Any) -> None:
    plain = dice.make("coin", Settings())
    assert type(plain).__name__ == "Coin" and plain.config.weight == 0.5
    heavy = dice.make("coin", Settings(options={"coin": {"weight": 0.75}}), seed=3)
    assert heavy.config.weight == 0.75 and heavy.seed == 3


@pytest.mark.parametrize(
    ("options", "said"),
    [({"wieght": 0.75}, "options.coin does not fit"), ({"weight": 2.0}, "weight lies between 0 and 1, not 2.0")],
)
def test_options_that_do_not_fit_are_told(dice: Any, options: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said) as error:
        dice.make("coin", Settings(options={"coin": options}))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("name", "said"), [("cion", "did you mean 'coin'"), ("zzz", "there are die, coin, gone")])
def test_an_unknown_name_is_told_with_what_there_is(dice: Any, name: str, said: str) -> None:
    for ask in (dice.check, dice.load, lambda name: dice.make(name, Settings())):
        with pytest.raises(UsageError, match=f"there is no '{name}' among the dice; {said}"):
            ask(name)


@pytest.mark.parametrize("name", ["gone", "lacking", "broken"])
def test_what_cannot_be_loaded_is_told_in_one_line_with_where_it_comes_from(dice: Any, name: str) -> None:
    """A package that is half installed, one that renamed its class, one that fails when it is imported."""
    dice.check(name)  # that it is there can be told without loading it
    with pytest.raises(UsageError, match=f"'{name}' of the dice cannot be loaded from {ADDED[name]}") as error:
        dice.load(name)
    assert "\n" not in str(error.value)


def test_a_box_without_parameters_is_told(dice: Any) -> None:
    with pytest.raises(UsageError, match="'bare' of the dice") as error:
        dice.make("bare", SimpleNamespace(options={}))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "module", ["perception.config", "perception.encoders", "agents", "planning.config", "grounding"]
)
def test_every_box_of_this_package_can_be_loaded(module: str) -> None:
    found = [value for value in vars(__import__(f"semrl.{module}", fromlist=["*"])).values() if type(value) is Registry]
    assert found
    for one in found:
        for name in one._builtin:
            assert callable(one.load(name)), (one.group, name)
