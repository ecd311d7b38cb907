"""The messages of ROS 2 that a session sends and takes, with the type names that ROS 2 gives them in DDS.

All are messages that come with ROS 2. Fields are those of its interface definitions; angles, lengths and speeds are SI.
"""

import json
from dataclasses import dataclass, field
from hashlib import sha256
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin, get_type_hints

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, int32, sequence, uint8, uint32

if TYPE_CHECKING:
    Covariance = list[float]
    Ranges = list[float]
    Octets = list[int]
    Data = list[int]
else:
    Covariance = array[float, 36]
    Ranges = sequence[float32]
    Octets = array[uint8, 16]
    Data = sequence[uint8]


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
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """A text."""

    data: str = ""


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    """A pose, with when, and in which frame of reference."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    """A length of time."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class ColorRGBA(IdlStruct, typename="std_msgs::msg::dds_::ColorRGBA_"):
    """A colour; parts are from 0 to 1."""

    r: float32 = 0.0
    g: float32 = 0.0
    b: float32 = 0.0
    a: float32 = 1.0


@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    """A picture."""

    header: Header = field(default_factory=Header)
    format: str = ""
    data: Data = field(default_factory=list[int])


@dataclass
class UVCoordinate(IdlStruct, typename="visualization_msgs::msg::dds_::UVCoordinate_"):
    """A place in a picture."""

    u: float32 = 0.0
    v: float32 = 0.0


@dataclass
class MeshFile(IdlStruct, typename="visualization_msgs::msg::dds_::MeshFile_"):
    """A mesh."""

    filename: str = ""
    data: Data = field(default_factory=list[int])


if TYPE_CHECKING:
    Points = list[Point]
    Colors = list[ColorRGBA]
    Coordinates = list[UVCoordinate]
else:
    Points = sequence[Point]
    Colors = sequence[ColorRGBA]
    Coordinates = sequence[UVCoordinate]


@dataclass
class Marker(IdlStruct, typename="visualization_msgs::msg::dds_::Marker_"):
    """What RViz draws (`transports.marks`)."""

    header: Header = field(default_factory=Header)
    ns: str = ""
    id: int32 = 0
    type: int32 = 0
    action: int32 = 0
    pose: Pose = field(default_factory=Pose)
    scale: Vector3 = field(default_factory=Vector3)
    color: ColorRGBA = field(default_factory=ColorRGBA)
    lifetime: Duration = field(default_factory=Duration)
    frame_locked: bool = False
    points: Points = field(default_factory=list[Point])
    colors: Colors = field(default_factory=list[ColorRGBA])
    texture_resource: str = ""
    texture: CompressedImage = field(default_factory=CompressedImage)
    uv_coordinates: Coordinates = field(default_factory=list[UVCoordinate])
    text: str = ""
    mesh_resource: str = ""
    mesh_file: MeshFile = field(default_factory=MeshFile)
    mesh_use_embedded_materials: bool = False


if TYPE_CHECKING:
    Markers = list[Marker]
else:
    Markers = sequence[Marker]


@dataclass
class MarkerArray(IdlStruct, typename="visualization_msgs::msg::dds_::MarkerArray_"):
    """Markers."""

    markers: Markers = field(default_factory=list[Marker])


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    """The number of a participant, a reader or a writer."""

    data: Octets = field(default_factory=lambda: [0] * 16)


if TYPE_CHECKING:
    Gids = list[Gid]
else:
    Gids = sequence[Gid]


@dataclass
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    """A node of a participant, with its readers and writers."""

    node_namespace: str = "/"
    node_name: str = ""
    reader_gid_seq: Gids = field(default_factory=list[Gid])
    writer_gid_seq: Gids = field(default_factory=list[Gid])


if TYPE_CHECKING:
    Nodes = list[NodeEntitiesInfo]
else:
    Nodes = sequence[NodeEntitiesInfo]


@dataclass
class ParticipantEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    """The nodes of a participant: what `ros2 node list` shows."""

    gid: Gid = field(default_factory=Gid)
    node_entities_info_seq: Nodes = field(default_factory=list[NodeEntitiesInfo])


NESTED = 1
NUMBERS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9, "float32": 10,
}  # fmt: skip
PLAIN = {float: 11, bool: 15, str: 17}
ARRAY, UNBOUNDED = 48, 144
"""Numbers of types, as REP 2016 has them in `type_description_interfaces/msg/FieldType`; a field's number is that of
its elements plus one of the last two."""


def type_hash(kind: type[IdlStruct]) -> str:
    """Return the hash of a message's definition, by which nodes of ROS 2 tell whether they mean the same (REP 2011)."""
    described: dict[str, Any] = {}
    _describe(kind, described)
    first = described.pop(_name_of(kind))
    text = {
        "type_description": first,
        "referenced_type_descriptions": [described[name] for name in sorted(described)],
    }
    return f"RIHS01_{sha256(json.dumps(text).encode()).hexdigest()}"


def _name_of(kind: Any) -> str:
    package, group, _, name = kind.__idl_typename__.split("::")
    return f"{package}/{group}/{name.removesuffix('_')}"


def _describe(kind: Any, described: dict[str, Any]) -> None:
    fields: list[Any] = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        number, capacity, inner = _field(hint)
        if inner is not None:
            _describe(inner, described)
        nested = "" if inner is None else _name_of(inner)
        told = {"type_id": number, "capacity": capacity, "string_capacity": 0, "nested_type_name": nested}
        fields.append({"name": name, "type": told})
    described[_name_of(kind)] = {"type_name": _name_of(kind), "fields": fields}


def _field(hint: Any) -> tuple[int, int, Any]:
    """Return the number of a field's type, its length if that is fixed, and the type that is nested in it."""
    if get_origin(hint) is not Annotated:
        return (PLAIN[hint], 0, None) if hint in PLAIN else (NESTED, 0, hint)
    how = get_args(hint)[1]
    if isinstance(how, str):
        return NUMBERS[how], 0, None
    number, _, inner = _field(how.subtype)
    return (number + ARRAY, how.length, inner) if isinstance(how, array) else (number + UNBOUNDED, 0, inner)
