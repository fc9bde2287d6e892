"""Grounding (§3.4.4): what the agent is shown of the plan."""

from semrl.core.registry import Registry
from semrl.grounding.plan_features import PlanFeature, PlanFeatures, PlanFeaturesConfig
from semrl.grounding.protocol import Grounder

GROUNDERS: Registry[Grounder] = Registry("grounders", {"plan_features": "semrl.grounding:PlanFeatures"})

__all__ = ["GROUNDERS", "Grounder", "PlanFeature", "PlanFeatures", "PlanFeaturesConfig"]
