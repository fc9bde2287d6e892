"""The objects of a Pong frame (§3.2.1)."""

import tyro

from semrl import make_env
from semrl.perception.detection import OtsuDetector


def main(decisions: int = 60) -> None:
    """Play some decisions at random, fix the threshold meanwhile, and print the objects of the last frame."""
    env, detector = make_env(), OtsuDetector()
    frame, _ = env.reset(seed=0)
    for _ in range(decisions):
        detector.partial_fit(frame)
        frame, *_ = env.step(env.action_space.sample())
    objects = detector.detect(frame)
    print(f"{len(objects)} objects brighter than {detector.threshold_:.0f} of 255")
    for (row, column), (_, _, height, width) in zip(objects.centres_px, objects.boxes_px, strict=True):
        print(f"row {row:4.1f}  column {column:4.1f}  {height}×{width} px")


if __name__ == "__main__":
    tyro.cli(main)
