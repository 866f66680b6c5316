"""The monitor as a lifecycle node; what it does while configured is in `session`."""

from __future__ import annotations

import logging
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import wraps

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from proximity_monitor import engine
from proximity_monitor.ros import parameters
from proximity_monitor.ros.descriptions import Descriptions
from proximity_monitor.ros.scene_parameters import SceneParameters
from proximity_monitor.ros.session import Session
from proximity_monitor.ros.spin import ros, spin
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.naming import counted
from proximity_monitor.scene.opening import find_scene

RCLError = rclpy_implementation.RCLError

Transition = Callable[["ProximityMonitor", LifecycleState], TransitionCallbackReturn]


def _told(transition: Transition) -> Transition:
    """Make a transition log its exceptions; rclpy itself drops them silently."""

    @wraps(transition)
    def run(self: ProximityMonitor, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except (
            OSError,
            ValueError,
        ) as error:  # the user has to mend a scene, a model or a parameter
            self.get_logger().fatal(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception:
            self.get_logger().fatal(traceback.format_exc())
            return TransitionCallbackReturn.ERROR

    return run


class ProximityMonitor(LifecycleNode):
    """Watches the clearances of a scene; docs/node.md lists topics, parameters and services."""

    def __init__(self, **node_options) -> None:
        """Declare the parameters; everything else is made when the node is configured.

        Args:
            node_options: for `rclpy.node.Node`, such as parameter_overrides.

        Raises:
            rclpy.exceptions.ParameterException: a parameter given at start has the wrong type or an
                illegal value.
        """
        super().__init__("proximity_monitor", **node_options)
        self._session: Session | None = None
        self._declared: SceneParameters | None = None
        self._descriptions = Descriptions(self)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        parameters.declare(self)
        self._survive_impossible_transitions()

    def start(self) -> bool:
        """Configure and activate, as `autostart` asks; return whether both succeeded."""
        return all(
            trigger() is TransitionCallbackReturn.SUCCESS
            for trigger in (self.trigger_configure, self.trigger_activate)
        )

    def destroy_node(self) -> None:
        """Remove the markers, free everything and leave the graph."""
        self._free()
        super().destroy_node()

    @_told
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the scene, prepare the search, create publishers, subscriptions and services."""
        scene = load_scene(find_scene(self.get_parameter("scene").value), self._descriptions.wait)
        self.get_logger().info(
            f"{scene.path}: {counted(len(scene.bodies), 'body', 'bodies')},"
            f" {counted(len(scene.pairs), 'pair', 'pairs')}; preparing the search"
        )
        for warning in scene.warnings:
            self.get_logger().warning(warning)
        declared = self._declared = SceneParameters(self, scene)
        if declared.unadjustable:
            self.get_logger().info(
                f"{declared.unadjustable} pairs have their own thresholds: too many for"
                " parameters, so these keep the values of the scene file"
            )
        try:
            self._session = Session(self, scene, declared.settings())
            self._session.prepare()
        except BaseException:
            self._free()
            raise
        return super().on_configure(state)

    @_told
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start ticking."""
        result = super().on_activate(state)
        self._session.start()
        settings = self._session.settings
        self.get_logger().info(
            f"watching at {settings.rate_hz:g} Hz, budget {settings.budget_s * 1e3:g} ms a tick,"
            f" frame {settings.frame}"
        )
        return result

    @_told
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop ticking; poses are still received."""
        self._session.stop()
        return super().on_deactivate(state)

    @_told
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Free everything that configuring made."""
        self._free()
        return TransitionCallbackReturn.SUCCESS

    @_told
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Free everything, from any state."""
        self._free()
        return TransitionCallbackReturn.SUCCESS

    @_told
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Free everything after an unexpected error, so that the node can be configured again."""
        self._free()
        return TransitionCallbackReturn.SUCCESS

    def _survive_impossible_transitions(self) -> None:
        """Refuse a transition that the present state does not have.

        rclpy would raise out of the service's callback, which ends the process.
        """
        service = self._service_change_state
        change = service.callback

        def answer(
            request: ChangeState.Request, response: ChangeState.Response
        ) -> ChangeState.Response:
            try:
                return change(request, response)
            except RCLError as error:
                self.get_logger().warning(
                    f"this transition is not possible in the present state: {error}"
                )
                response.success = False
                return response

        service.callback = answer

    def _free(self) -> None:
        session, self._session = self._session, None
        declared, self._declared = self._declared, None
        self._descriptions.forget()
        if session is not None:
            session.close()
        if declared is not None:
            declared.undeclare()

    def _check_parameters(self, changes: Sequence[Parameter]) -> SetParametersResult:
        if self._declared is not None:
            return self._declared.check(changes)
        changed = {parameter.name: parameter.value for parameter in changes}
        reason = parameters.refusal(parameters.values(self) | changed, tuple(changed))
        return SetParametersResult(successful=not reason, reason=reason)

    def _apply_parameters(self, changes: Sequence[Parameter]) -> None:
        if self._session is not None:
            self._session.apply(self._declared.settings())


class _ToLog(logging.Handler):
    """Passes the engine's log messages, such as that it compiles, to a node's log."""

    def __init__(self, node: ProximityMonitor) -> None:
        super().__init__(logging.WARNING)
        self._log = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        """Log one message."""
        self._log.warning(record.getMessage())


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return 1 if it cannot start."""
    with ros(args, "proximity_monitor") as stop:
        try:
            node = ProximityMonitor()
        except ParameterException as error:
            print(f"proximity_monitor: {error}", file=sys.stderr)
            return 1
        logging.getLogger(engine.__name__).addHandler(_ToLog(node))
        try:
            if node.get_parameter("autostart").value and not node.start():
                return 1
            spin([node], stop)
        finally:
            node.destroy_node()
    return 0
