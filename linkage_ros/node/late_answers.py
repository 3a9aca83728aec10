# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""A service whose answer comes when it is known, without an executor that waits for it."""

from __future__ import annotations

from typing import Any


class LateAnswers:
    """
    Lets the callback of a service return before it knows the answer.

    A callback that is a coroutine would do so too, but rclpy's executor then asks it again and
    again, and each of its rounds costs as much as five ticks.

    Parameters
    ----------
    service
        The service, an rclpy ``Service``; one answer at a time is late.

    """

    def __init__(self, service: Any) -> None:
        self._send = service.send_response
        self._late: Any = None
        self._to: Any = None
        service.send_response = self._send_or_keep

    def defer(self, response: Any) -> Any:
        """Return the response, to be returned by the callback, which is not sent yet."""
        self._late = response
        return response

    def answer(self, success: bool, message: str) -> None:
        """Send the response that was deferred; on the executor's thread, or when it has ended."""
        response, self._late = self._late, None
        response.success, response.message = success, message
        self._send(response, self._to)

    def _send_or_keep(self, response: Any, to: Any) -> None:
        if response is self._late:
            self._to = to
        else:
            self._send(response, to)
