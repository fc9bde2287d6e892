"""Labelled images: near labels look far apart."""

import numpy as np

from semrl.perception.detection import label_image


def test_labels_get_levels_far_from_each_other_and_from_the_background():
    image = label_image(np.arange(12))
    assert image.dtype == np.uint8
    assert image[0] == 0 and image[1] == 255 and image[11] == 55
    assert (np.diff(np.sort(image)) >= 20).all()


def test_a_label_keeps_its_level_and_higher_ones_share_them():
    labels = np.random.default_rng(0).integers(3000, size=(84, 84)).astype(np.int32)
    kept = labels.copy()
    image = label_image(labels)
    np.testing.assert_array_equal(labels, kept)
    np.testing.assert_array_equal(image == 0, labels == 0)
    np.testing.assert_array_equal(image, label_image(np.where(labels > 11, labels - 11, labels)))
    assert image[labels > 0].min() == 55
