"""The monitor's own services."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger


class Services:
    """Answers ~/reset_minima, ~/pause and ~/dump_recording."""

    def __init__(
        self,
        node: Node,
        *,
        reset: Callable[[], str],
        pause: Callable[[bool], str],
        dump: Callable[[], Awaitable[str]],
    ) -> None:
        """Create the services.

        Args:
            node: the node that offers the services.
            reset: forgets the session's minima. Like the other two, it returns the answer's text.
            pause: pauses the watch if called with True, else lets it go on.
            dump: writes the recording while the watch goes on; its future raises OSError or
                ImportError if it fails.
        """
        self._node = node

        def on_reset(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = True, reset()
            return response

        def on_pause(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            response.success, response.message = True, pause(request.data)
            return response

        async def on_dump(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.success, response.message = True, await dump()
            except (OSError, ImportError) as error:
                response.success, response.message = False, str(error)
                node.get_logger().error(f"dump_recording: {error}")
            return response

        # In its own callback group, because nothing else in the group is called before it answers.
        alone = MutuallyExclusiveCallbackGroup()
        self._services = [
            node.create_service(Trigger, "~/reset_minima", on_reset),
            node.create_service(SetBool, "~/pause", on_pause),
            node.create_service(Trigger, "~/dump_recording", on_dump, callback_group=alone),
        ]

    def destroy(self) -> None:
        """Destroy the services."""
        for service in self._services:
            # A dump may still be going on; rclpy raises when it answers for a destroyed service.
            service.send_response = lambda *_: None
            self._node.destroy_service(service)
