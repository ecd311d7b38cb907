"""The messages of ROS 2 that a session sends and takes, with the type names that ROS 2 gives them in DDS.

Fields are those of ROS 2's interface definitions; angles, lengths and speeds are SI. `dubins_traffic_msgs`,
`integrator_chains_msgs` and the service `MMode` are the definitions of 2016 written as ROS 2 would.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, int16, int32, int64, sequence, uint8, uint32, uint64

if TYPE_CHECKING:
    Covariance = list[float]
    Ranges = list[float]
    Texts = list[str]
else:
    Covariance = array[float, 36]
    Ranges = sequence[float32]
    Texts = sequence[str]


def _no_covariance() -> list[float]:
    return [0.0] * 36


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Seconds and nanoseconds."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """When, and in which frame of reference."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """A vector."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    """A position."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """A rotation."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    """Position and orientation."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    """Velocities."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    """A pose and how sure it is."""

    pose: Pose = field(default_factory=Pose)
    covariance: Covariance = field(default_factory=_no_covariance)


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    """A twist and how sure it is."""

    twist: Twist = field(default_factory=Twist)
    covariance: Covariance = field(default_factory=_no_covariance)


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    """Where a car believes it is."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class LaserScan(IdlStruct, typename="sensor_msgs::msg::dds_::LaserScan_"):
    """Ranges from right to left."""

    header: Header = field(default_factory=Header)
    angle_min: float32 = 0.0
    angle_max: float32 = 0.0
    angle_increment: float32 = 0.0
    time_increment: float32 = 0.0
    scan_time: float32 = 0.0
    range_min: float32 = 0.0
    range_max: float32 = 0.0
    ranges: Ranges = field(default_factory=list[float])
    intensities: Ranges = field(default_factory=list[float])


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    """Where one frame of reference lies in another."""

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    """The same, with when, and of which frames."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    """Simulated time."""

    clock: Time = field(default_factory=Time)


if TYPE_CHECKING:
    Poses = list[Pose]
    Twists = list[Twist]
    Transforms = list[TransformStamped]
else:
    Poses = sequence[Pose]
    Twists = sequence[Twist]
    Transforms = sequence[TransformStamped]


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    """Transforms."""

    transforms: Transforms = field(default_factory=list[TransformStamped])


@dataclass
class ModelState(IdlStruct, typename="gazebo_msgs::msg::dds_::ModelState_"):
    """Where a car shall be."""

    model_name: str = ""
    pose: Pose = field(default_factory=Pose)
    twist: Twist = field(default_factory=Twist)
    reference_frame: str = ""


@dataclass
class ModelStates(IdlStruct, typename="gazebo_msgs::msg::dds_::ModelStates_"):
    """Where all cars are."""

    name: Texts = field(default_factory=list[str])
    pose: Poses = field(default_factory=list[Pose])
    twist: Twists = field(default_factory=list[Twist])


@dataclass
class LabelStamped(IdlStruct, typename="dubins_traffic_msgs::msg::dds_::LabelStamped_"):
    """Labels that hold."""

    header: Header = field(default_factory=Header)
    label: Texts = field(default_factory=list[str])


@dataclass
class ProblemInstanceJSON(IdlStruct, typename="integrator_chains_msgs::msg::dds_::ProblemInstanceJSON_"):
    """A problem instance, version 0; empty at the end of a trial."""

    stamp: Time = field(default_factory=Time)
    problemjson: str = ""


@dataclass
class ModeRequest(IdlStruct, typename="dubins_traffic_msgs::srv::dds_::MMode_Request_"):
    """A request to the maestro, after the client and the number of the request, by which it knows its reply."""

    guid: uint64 = 0
    seq: int64 = 0
    mode: int16 = 0


@dataclass
class ModeReply(IdlStruct, typename="dubins_traffic_msgs::srv::dds_::MMode_Response_"):
    """The maestro's reply to a request."""

    guid: uint64 = 0
    seq: int64 = 0
    result: bool = False


@dataclass
class EmptyRequest(IdlStruct, typename="std_srvs::srv::dds_::Empty_Request_"):
    """A request that says nothing; ROS 2 gives every message that is empty a byte."""

    guid: uint64 = 0
    seq: int64 = 0
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class EmptyReply(IdlStruct, typename="std_srvs::srv::dds_::Empty_Response_"):
    """The reply to it."""

    guid: uint64 = 0
    seq: int64 = 0
    structure_needs_at_least_one_member: uint8 = 0
