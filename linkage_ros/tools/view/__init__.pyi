# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: serve, Server, Route, RequestHandler, build_model, model_of, edit_text, EditResult,
# LiveBridge, page_html, bag_page, LinkagePage.

from linkage_ros.tools.view.conversation import Conversation as Conversation, UserFile as UserFile
from linkage_ros.tools.view.edit import (
    edit_text as edit_text,
    EditResult as EditResult,
    pin_of as pin_of,
)
from linkage_ros.tools.view.hand_crank import HandCrank as HandCrank, HELD as HELD
from linkage_ros.tools.view.live import add_live as add_live, live_page as live_page
from linkage_ros.tools.view.live_bridge import LiveBridge as LiveBridge
from linkage_ros.tools.view.model import (
    build_model as build_model,
    model_of as model_of,
    ViewState as ViewState,
)
from linkage_ros.tools.view.page import LinkagePage as LinkagePage, page_html as page_html
from linkage_ros.tools.view.report_command import bag_page as bag_page
from linkage_ros.tools.view.requests import (
    EXPORT_KINDS as EXPORT_KINDS,
    export_linkage as export_linkage,
    LARGEST as LARGEST,
    read_request as read_request,
    RequestError as RequestError,
    RequestHandler as RequestHandler,
)
from linkage_ros.tools.view.sensors import SceneFiles as SceneFiles, Sensors as Sensors
from linkage_ros.tools.view.server import (
    MOST_PAGES as MOST_PAGES,
    Route as Route,
    serve as serve,
    Server as Server,
)
from linkage_ros.tools.view.worker import Worker as Worker
