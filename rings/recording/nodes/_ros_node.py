"""A ROS 2 node for the messages of `ros_messages`; it only needs rclpy."""

import importlib
from array import array
from collections import deque
from collections.abc import Mapping
from typing import Any

from tactograph.rings.recording.files.ros_messages import Message
from tactograph.rings.recording.files.stamps import TouchStamps
from tactograph.sdk import InputError

QUEUE_MESSAGES = 8
"""Most messages of a topic that wait for a slow receiver; older ones are dropped."""


class RosNode:
    """A ROS 2 node in its own context.

    Parameters
    ----------
    name, namespace : of the node; topics without a leading slash are below the namespace

    Attributes
    ----------
    stamps : of its messages

    Raises
    ------
    InputError
        If ROS is not installed or rejects the name.
    """

    def __init__(self, name: str, namespace: str) -> None:
        self.stamps = TouchStamps(follow=True)
        ros = _rclpy()
        # The default context would take Ctrl-C from the pipeline.
        self._context = ros.Context()
        self._context.init()
        try:
            self._node = ros.create_node(name, namespace=namespace, context=self._context)
        except Exception as error:
            self._context.try_shutdown()
            line = " ".join(str(error).split())
            raise InputError(
                f"ROS 2: `node_name`={name}, `namespace`={namespace}: {line}"
            ) from None
        executors = importlib.import_module("rclpy.executors")
        self._executor = executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._publishers: dict[str, Any] = {}

    def publish(self, messages: list[Message]) -> None:
        """Publish messages; a topic exists from its first message on.

        ``/diagnostics`` is shared by all of ROS; other topics are below the namespace.
        """
        for message in messages:
            if message.topic not in self._publishers:
                shared = message.topic == "/diagnostics"
                topic = message.topic if shared else message.topic.lstrip("/")
                kind = _class_of(message.type)
                self._publishers[message.topic] = self._node.create_publisher(
                    kind, topic, QUEUE_MESSAGES
                )
            publisher = self._publishers[message.topic]
            if publisher.get_subscription_count():
                publisher.publish(_filled(_class_of(message.type), message.body))

    def subscribe(self, topic: str, kind: str) -> deque[Any]:
        """A queue that `wait` fills with the messages of a topic, newest last."""
        messages: deque[Any] = deque(maxlen=QUEUE_MESSAGES)
        # This profile accepts what a camera driver offers, reliable or not.
        profile = importlib.import_module("rclpy.qos").qos_profile_sensor_data

        def take(message: Any) -> None:
            # rclpy inspects a callback's signature, which built-in functions do not have.
            messages.append(message)

        self._node.create_subscription(_class_of(kind), topic, take, profile)
        return messages

    def wait(self, seconds: float) -> None:
        """Receive messages, for at most `seconds`."""
        self._executor.spin_once(timeout_sec=seconds)

    def close(self) -> None:
        """Shut the node down."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def _rclpy() -> Any:
    try:
        return importlib.import_module("rclpy")
    except ImportError:
        raise InputError(
            "ROS 2 is not here: source its setup file, in an environment that sees its rclpy"
        ) from None


def _filled(kind: Any, values: Mapping[str, Any]) -> Any:
    """An instance of ROS's own class with these values."""
    fields = kind.get_fields_and_field_types()
    return kind(**{name: _value(fields[name], value) for name, value in values.items()})


def _value(kind: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        return _filled(_class_of(kind), value)
    if isinstance(value, list) and kind.startswith("sequence<"):
        element = _class_of(kind.removeprefix("sequence<").removesuffix(">"))
        return [_filled(element, each) for each in value]
    if isinstance(value, bytes):
        # In a list ROS would check every byte.
        return array("B", value)
    return bytes([value]) if kind == "octet" else value


def _class_of(name: str) -> Any:
    """The class of ``sensor_msgs/msg/Image``, or of ``sensor_msgs/Image`` as fields name it."""
    package, *_, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)
