"""World Models (§2.6.1; Ha & Schmidhuber 2018), as a comparison: V sees, M predicts, C acts and is found in a dream."""

from semrl_thesis.world_models.controller import ControllerConfig, LinearController, evolve
from semrl_thesis.world_models.dream import Dream, DreamConfig
from semrl_thesis.world_models.mdn_rnn import MDNRNN, LatentEpisode, MDNRNNConfig
from semrl_thesis.world_models.training import WorldModels, WorldModelsConfig
from semrl_thesis.world_models.vae import VAE, VAEConfig

__all__ = [
    "MDNRNN",
    "VAE",
    "ControllerConfig",
    "Dream",
    "DreamConfig",
    "LatentEpisode",
    "LinearController",
    "MDNRNNConfig",
    "VAEConfig",
    "WorldModels",
    "WorldModelsConfig",
    "evolve",
]
