"""A map as a knowledge base, asked in SPARQL: where most is lost, and what has gained there (§3.4.1)."""

import tyro
from state_map import ACTIONS, random_play

from semrl.knowledge.queries import ask
from semrl.knowledge.store import to_store
from semrl.planning.state_map import StateMap, StateMapConfig

QUERY = """
    SELECT ?state (SUM(?count) AS ?losses) (SAMPLE(?name) AS ?gaining) {
        ?loss a semrl:NegativeTransition; semrl:source ?state; semrl:count ?count .
        OPTIONAL { ?gain a semrl:PositiveTransition; semrl:source ?state; semrl:action/rdfs:label ?name }
    } GROUP BY ?state ORDER BY DESC(?losses) ?state LIMIT 5
"""


def main(episodes: int = 100) -> None:
    """Print the states from which most balls were missed, and an action that caught one there."""
    state_map = StateMap(StateMapConfig(node_threshold=0.03, edge_threshold=0.04), dimension=4, n_actions=len(ACTIONS))
    for trajectory in random_play(episodes):
        state_map.partial_fit(trajectory)
    answer = ask(to_store(state_map.graph_, ACTIONS), QUERY)
    print(*answer.variables)
    for row in answer.rows:
        print(*row)


if __name__ == "__main__":
    tyro.cli(main)
