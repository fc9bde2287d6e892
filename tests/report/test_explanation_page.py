"""The page about a decision, and the sentences on it."""

from dataclasses import replace

import pytest
from pages import Wellformed

from semrl.core.errors import UsageError
from semrl.evaluation.explaining import explain
from semrl.evaluation.explanation import PathEdge
from semrl.report import phrases
from semrl.report.explanation import render_explanation, write_explanation


@pytest.fixture(scope="module")
def told(map_run):
    return explain(map_run, episode=1, step=6)


def a_path(n):
    return tuple(
        PathEdge(
            source=100 + i,
            target=101 + i,
            edge=i,
            action="LEFT",
            share=1.0,
            count=3,
            reward=float(i == n - 1),
            cost=1.0,
        )
        for i in range(n)
    )


def words(page):
    return " ".join(page.words.split())


def test_everything_is_on_the_page(told, tmp_path):
    text = write_explanation(told, tmp_path / "why.html").read_text()
    page = Wellformed(text)
    said = words(page)
    assert f"Why {told.choice.action}?" in said and told.reason in said and phrases.shown_scenarios(told) in said
    assert phrases.otherwise(told) in said
    for scenario in told.scenarios:
        assert f'aria-label="{phrases.compact(scenario.actions)}: {phrases.rewards(scenario.rewards)}"' in text
        assert phrases.ending(told, scenario) in said
    assert phrases.place(told) in said and phrases.rollout(told) in said
    assert text.count('<rect x="') == len(told.sight.boxes_px) > 0
    assert page.headings[0] == 1 and page.headings.count(1) == 1 and page.unlabelled == []
    assert len(page.ids) == len(set(page.ids))


def test_of_many_other_actions_the_best_are_told(told):
    (other,) = told.otherwise
    many = tuple(replace(other, actions=(f"A{i}",), rewards=(0.0,), predicted_return=float(i)) for i in range(5))
    said = phrases.otherwise(replace(told, otherwise=many))
    assert said.startswith("A4 now brings +4 at best, no reward; A3") and "A2" in said and "A1" not in said
    assert said.endswith("none of the other 2 brings more.")


def test_nothing_is_fetched(told):
    text = render_explanation(told)
    assert all(address.startswith(("data:", "#")) for address in Wellformed(text).fetched)
    for outside in ("http:", "https:", "@import", "url(", "<script", "<link"):
        assert outside not in text


def test_it_is_the_same_each_time_and_keeps_to_what_was_there(told, tmp_path):
    assert render_explanation(told) == render_explanation(told)
    page = tmp_path / "why.html"
    page.write_text("old")
    write_explanation(told, page)
    assert "old" not in page.read_text()[:10] and list(tmp_path.iterdir()) == [page]


def test_names_are_no_markup(told):
    hostile = "<script>alert('x')</script>"
    text = render_explanation(replace(told, run=hostile))
    assert hostile not in text and "&lt;script&gt;" in text


@pytest.mark.parametrize(("n", "omitted"), [(1, 0), (2, 0), (9, 0), (10, 2), (60, 52)])
def test_a_path_is_drawn_from_here_to_the_gain(told, n, omitted):
    e = replace(told, path=a_path(n))
    first, left_out, last = phrases.shortened(e.path)
    assert left_out == omitted and len(first) + omitted + len(last) == n
    text = render_explanation(e)
    said = words(Wellformed(text))
    assert text.count('class="hop"') == n - omitted and text.count('class="node here') == 1
    assert text.count(' goal"><b>') == 1 and f"node {100 + n}" in said
    assert (f"… {omitted} steps …" in said) == bool(omitted)
    assert phrases.way(e).startswith("100 ─LEFT→ ") and phrases.way(e).endswith(f"{100 + n} (+1)")
    assert all(f"<td>{hop.source}</td>" in text for hop in e.path)


def test_scenarios_that_end_on_the_path_are_marked_there(told):
    scenarios = tuple(
        replace(scenario, end_node=102, progress=2 if scenario.rank in (1, 3) else None) for scenario in told.scenarios
    )
    said = words(Wellformed(render_explanation(replace(told, path=a_path(5), scenarios=scenarios))))
    assert "102 scenarios 1, 3" in said.replace("102scenarios", "102 scenarios") and "3 of 5 on the path" in said


def test_without_a_way_there_is_no_chain(told):
    e = replace(told, path=(), place=replace(told.place, distance=None, is_goal=False))
    text = render_explanation(e)
    assert "No way to a gain is known that costs 100 or less." in text and '<ol class="chain">' not in text


def test_a_page_that_cannot_be_written(told, tmp_path):
    with pytest.raises(UsageError, match="it is a folder"):
        write_explanation(told, tmp_path)
    with pytest.raises(UsageError, match="there is no folder"):
        write_explanation(told, tmp_path / "none" / "why.html")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((0, 0), "no reward"),
        ((1,), "+1 after 1 decision"),
        ((0, -1, 0), "−1 after 2 decisions"),
        ((-1, 0, 1, 1, 1), "−1 after 1, +1 after 3–5 decisions"),
        ((1, -1), "+1 after 1, −1 after 2 decisions"),
    ],
)
def test_rewards_in_words(values, said):
    assert phrases.rewards(values) == said


def test_actions_in_short():
    assert phrases.compact(["UP", "UP", "UP", "DOWN", "UP"]) == "UP ×3, DOWN, UP"
    assert phrases.compact(["UP", "DOWN"] * 2) == "(UP, DOWN) ×2" and phrases.compact(["UP", "DOWN"]) == "UP, DOWN"
    assert phrases.compact(["LEFT", *["UP", "DOWN"] * 3, "UP", "UP"]) == "LEFT, (UP, DOWN) ×3, UP ×2"
    assert phrases.compact(["UP", "UP", "DOWN", "DOWN"] * 2) == "UP ×2, DOWN ×2, UP ×2, DOWN ×2"


@pytest.mark.parametrize(
    ("policy", "agent", "planner", "said"),
    [
        ("agent", "LEFT", "LEFT", "The agent took LEFT, whose value is the highest: LEFT 1, RIGHT −0.5; "
         "the planner would do the same."),
        ("agent", "LEFT", "RIGHT", "; the planner would take RIGHT."),
        ("planner", "RIGHT", "LEFT", "The planner took LEFT, with which its best scenario begins; "
         "the agent would take RIGHT."),
        ("agent", "RIGHT", "RIGHT", "Chance took LEFT, as in 1 % of an evaluation's decisions; "
         "agent and planner wanted RIGHT."),
        ("planner", "LEFT", "RIGHT", "the planner wanted RIGHT, the agent LEFT."),
    ],
)  # fmt: skip
def test_who_wanted_what(told, policy, agent, planner, said):
    values = {"LEFT": 1.0, "RIGHT": -0.5}
    by_chance = {"agent": agent, "planner": planner}[policy] != "LEFT"
    choice = replace(told.choice, action="LEFT", agent=agent, planner=planner, by_chance=by_chance, values=values)
    assert phrases.choice(replace(told, policy=policy, exploration=0.01, choice=choice)).endswith(said)
