"""An agent of your own in one file, as CleanRL writes them: actor-critic on tracked objects, several games at once."""

from pathlib import Path

import gymnasium as gym
import torch
import tyro
from torch import nn

from semrl import SemanticVectorObservation, make_env, preset, train


def main(run: Path = Path("runs/eyes"), /, env: str = "PongNoFrameskip-v4", decisions: int = 2_000) -> None:
    """Learn on what the perception of a run sees; where there is none a small one is trained first."""
    if not run.exists():
        train(run, preset("semrl", "objects", {"env": env, "decisions": 600, "stability": {"decisions": 500}}))
    envs = SemanticVectorObservation(gym.vector.SyncVectorEnv([lambda: make_env(env)] * 4), encoder=run)
    torch.manual_seed(0)
    size, n_actions = envs.single_observation_space.shape[0], envs.single_action_space.n
    network = nn.Sequential(nn.LayerNorm(size), nn.Linear(size, 128), nn.ReLU(), nn.Linear(128, n_actions + 1))
    optimiser = torch.optim.Adam(network.parameters(), 1e-3)
    seen, brought, over = envs.reset(seed=0)[0], [], torch.zeros(envs.num_envs, dtype=torch.bool)
    for _ in range(0, decisions, 16 * envs.num_envs):
        steps = []
        for _ in range(16):
            *logits, value = network(torch.as_tensor(seen)).unbind(1)
            policy = torch.distributions.Categorical(logits=torch.stack(logits, 1))
            action = policy.sample()
            seen, reward, ended, cut, _ = envs.step(action.numpy())
            played, over = ~over, torch.as_tensor(ended | cut)  # after an end a game begins anew, whatever is done
            steps.append((value, policy, action, torch.as_tensor(reward), over, played))
        returns, loss = network(torch.as_tensor(seen))[:, -1].detach(), torch.zeros(())
        for value, policy, action, reward, end, played in reversed(steps):
            returns = reward.float() + 0.99 * returns * ~end
            gain = (returns - value).detach() * policy.log_prob(action) + 0.01 * policy.entropy()
            loss = loss + (((returns - value) ** 2 / 2 - gain) * played).mean() / len(steps)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        brought.append(sum(float(reward.mean()) for *_, reward, _, _ in steps))
    print(f"on {', '.join(envs.feature_names[:3])} … a game brought {sum(brought):+.0f}")


if __name__ == "__main__":
    tyro.cli(main)
