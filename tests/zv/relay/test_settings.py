"""Which stream the relay's argument means."""

from __future__ import annotations

import re

import pytest

from zenoh_vision.errors import ConfigurationError
from zv.relay.settings import RelaySettings


@pytest.mark.parametrize(
    ("given", "camera", "topic"),
    [
        ({}, "front", "image/compressed"),
        ({"camera": "rear"}, "rear", "image/compressed"),
        ({"camera": "rear", "key": "tracked/compressed"}, "rear", "tracked/compressed"),
        ({"key": "image"}, "front", "image"),
        ({"key": "vision/left/edges/compressed"}, "left", "edges/compressed"),
        ({"key": "/vision/left/image/compressed"}, "left", "image/compressed"),
        ({"key": "left/image/compressed"}, "left", "image/compressed"),
        ({"key": "vision/left/thermal"}, "left", "thermal"),
    ],
)
def test_a_key_a_topic_or_a_camera_names_the_stream(given, camera, topic):
    assert RelaySettings(**given).stream("vision") == (camera, topic)


@pytest.mark.parametrize("key", ["other/left/image/compressed/x", "left", "vision/Left/image"])
def test_any_other_key_is_refused(key: str):
    with pytest.raises(ConfigurationError, match="is not allowed"):
        RelaySettings(key=key).stream("vision")


def test_the_node_is_named_after_the_camera_as_which_it_publishes():
    assert RelaySettings(key="vision/left/image").node_name == "relay_left"
    assert RelaySettings(to="left_flat").node_name == "relay_left_flat"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"to": "front"}, "allowed: the name of another camera, or leave it out"),
        ({"to": "rear", "key": "vision/rear/tracked/compressed"}, "to = 'rear' is not allowed"),
        ({"key": "relayed/compressed"}, "allowed: another stream of pictures, or --to"),
        ({"key": "/vision/left/relayed/compressed"}, "since the relay publishes on it"),
    ],
)
def test_a_relay_of_what_it_publishes_itself_is_refused(given, said: str):
    settings = RelaySettings(**given)
    for name in (lambda: settings.stream("vision"), lambda: settings.node_name):
        with pytest.raises(ConfigurationError, match=re.escape(said)):
            name()


@pytest.mark.parametrize("key", ["centroid", "vision/left/camera_info"])
def test_what_is_no_stream_of_pictures_is_refused_with_those_that_there_are(key: str):
    said = "is no stream of pictures; allowed: image/compressed, image, tracked/compressed"
    with pytest.raises(ConfigurationError, match=said):
        RelaySettings(key=key).stream("vision")


def test_what_one_relay_publishes_another_may_publish_as_a_camera():
    settings = RelaySettings(key="relayed/compressed", to="small")
    assert settings.stream("vision") == ("front", "relayed/compressed")
