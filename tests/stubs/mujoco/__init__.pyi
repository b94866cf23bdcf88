from collections.abc import Callable
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]

__version__: str

class FatalError(Exception): ...

class mjtObj(IntEnum):
    mjOBJ_BODY = 1
    mjOBJ_JOINT = 3
    mjOBJ_GEOM = 5
    mjOBJ_SITE = 6
    mjOBJ_CAMERA = 7
    mjOBJ_LIGHT = 8
    mjOBJ_FLEX = 9
    mjOBJ_MESH = 10
    mjOBJ_SKIN = 11
    mjOBJ_MATERIAL = 14
    mjOBJ_ACTUATOR = 19
    mjOBJ_SENSOR = 20

class mjtGeom(IntEnum):
    mjGEOM_PLANE = 0
    mjGEOM_HFIELD = 1
    mjGEOM_SPHERE = 2
    mjGEOM_CAPSULE = 3
    mjGEOM_ELLIPSOID = 4
    mjGEOM_CYLINDER = 5
    mjGEOM_BOX = 6
    mjGEOM_MESH = 7
    mjGEOM_SDF = 8

class mjtWrap(IntEnum):
    mjWRAP_JOINT = 1

class mjtTexture(IntEnum):
    mjTEXTURE_2D = 0
    mjTEXTURE_CUBE = 1
    mjTEXTURE_SKYBOX = 2

class mjtTextureRole(IntEnum):
    mjTEXROLE_RGB = 1
    mjTEXROLE_OCCLUSION = 2
    mjTEXROLE_ROUGHNESS = 3
    mjTEXROLE_METALLIC = 4
    mjTEXROLE_NORMAL = 5
    mjTEXROLE_OPACITY = 6
    mjTEXROLE_EMISSIVE = 7
    mjTEXROLE_RGBA = 8
    mjTEXROLE_ORM = 9

class mjtLightType(IntEnum):
    mjLIGHT_SPOT = 0
    mjLIGHT_DIRECTIONAL = 1
    mjLIGHT_POINT = 2
    mjLIGHT_IMAGE = 3

class mjtCamLight(IntEnum):
    mjCAMLIGHT_FIXED = 0

class mjtProjection(IntEnum):
    mjPROJ_PERSPECTIVE = 0
    mjPROJ_ORTHOGRAPHIC = 1

class mjtJoint(IntEnum):
    mjJNT_HINGE = 3

class mjtSensor(IntEnum):
    mjSENS_ACCELEROMETER = 1
    mjSENS_GYRO = 3

class mjtIntegrator(IntEnum):
    mjINT_IMPLICITFAST = 3

class mjtCone(IntEnum):
    mjCONE_ELLIPTIC = 1

class mjtMeshInertia(IntEnum):
    mjMESH_INERTIA_CONVEX = 0

class mjtTrn(IntEnum):
    mjTRN_JOINT = 0

class mjtEnableBit(IntEnum):
    mjENBL_SLEEP = 16

class mjtWarning(IntEnum):
    mjWARN_BADQPOS = 3
    mjWARN_BADQVEL = 4
    mjWARN_BADQACC = 5

class MjLogConfig:
    @staticmethod
    def get() -> MjLogConfig: ...
    def set(self) -> None: ...
    logto_file: bool
    logto_console: bool

class _Headlight:
    ambient: Singles
    diffuse: Singles
    active: int

class _Map:
    zfar: float

class _Visual:
    headlight: _Headlight
    map: _Map

class _Statistic:
    center: Floats
    extent: float

class _Option:
    timestep: float
    integrator: mjtIntegrator
    cone: mjtCone
    impratio: float
    enableflags: int
    gravity: ArrayLike

class MjModel:
    @classmethod
    def from_xml_path(cls, filename: str, assets: dict[str, bytes] | None = None) -> Self: ...
    @classmethod
    def from_xml_string(cls, xml: str, assets: dict[str, bytes] | None = None) -> Self: ...
    vis: _Visual
    stat: _Statistic
    opt: _Option
    nq: int
    nv: int
    nu: int
    nkey: int
    ntendon: int
    site_group: Ints
    site_rgba: Floats
    tendon_adr: Ints
    tendon_group: Ints
    tendon_rgba: Floats
    wrap_type: Ints
    nbody: int
    ngeom: int
    nsite: int
    ncam: int
    nlight: int
    nmesh: int
    nskin: int
    nflex: int
    ntex: int
    nmat: int
    qpos0: Floats
    body_parentid: Ints
    body_rootid: Ints
    body_weldid: Ints
    body_mocapid: Ints
    body_dofnum: Ints
    body_geomadr: Ints
    body_geomnum: Ints
    body_subtreemass: Floats
    njnt: int
    jnt_type: Ints
    jnt_bodyid: Ints
    jnt_limited: Bools
    nsensor: int
    sensor_type: Ints
    sensor_objid: Ints
    geom_aabb: Floats
    geom_type: Ints
    geom_bodyid: Ints
    geom_dataid: Ints
    geom_group: Ints
    geom_matid: Ints
    geom_size: Floats
    geom_rgba: Singles
    site_bodyid: Ints
    site_pos: Floats
    site_quat: Floats
    cam_bodyid: Ints
    cam_pos: Floats
    cam_quat: Floats
    cam_mode: Ints
    cam_projection: Ints
    cam_fovy: Floats
    cam_resolution: Ints
    cam_sensorsize: Singles
    cam_intrinsic: Singles
    light_type: Ints
    light_bodyid: Ints
    light_active: Bools
    light_castshadow: Bools
    light_attenuation: Singles
    light_cutoff: Singles
    light_exponent: Singles
    light_ambient: Singles
    light_diffuse: Singles
    mat_texid: Ints
    mat_texuniform: Bools
    mat_texrepeat: Singles
    mat_rgba: Singles
    mat_emission: Singles
    mat_metallic: Singles
    mat_roughness: Singles
    mat_reflectance: Singles
    tex_type: Ints
    tex_height: Ints
    tex_width: Ints
    tex_nchannel: Ints
    tex_adr: NDArray[np.int64]
    tex_data: NDArray[np.uint8]
    mesh_vertadr: Ints
    mesh_vertnum: Ints
    mesh_faceadr: Ints
    mesh_facenum: Ints
    mesh_normaladr: Ints
    mesh_normalnum: Ints
    mesh_texcoordadr: Ints
    mesh_texcoordnum: Ints
    mesh_vert: Singles
    mesh_normal: Singles
    mesh_texcoord: Singles
    mesh_face: Ints
    mesh_facenormal: Ints
    mesh_facetexcoord: Ints
    hfield_nrow: Ints
    hfield_ncol: Ints
    hfield_adr: Ints
    hfield_size: Floats
    hfield_data: Singles
    flex_dim: Ints
    flex_matid: Ints
    flex_group: Ints
    flex_rgba: Singles
    flex_vertadr: Ints
    flex_vertnum: Ints
    flex_elemdataadr: Ints
    flex_elemnum: Ints
    flex_elem: Ints
    flex_shelldataadr: Ints
    flex_shellnum: Ints
    flex_shell: Ints
    skin_matid: Ints
    skin_group: Ints
    skin_rgba: Singles
    skin_inflate: Singles
    skin_vertadr: Ints
    skin_vertnum: Ints
    skin_texcoordadr: Ints
    skin_faceadr: Ints
    skin_facenum: Ints
    skin_boneadr: Ints
    skin_bonenum: Ints
    skin_vert: Singles
    skin_texcoord: Singles
    skin_face: Ints
    skin_bonevertadr: Ints
    skin_bonevertnum: Ints
    skin_bonebindpos: Singles
    skin_bonebindquat: Singles
    skin_bonebodyid: Ints
    skin_bonevertid: Ints
    skin_bonevertweight: Singles

    def body(self, name: str) -> _Body: ...
    def joint(self, name: str) -> _Joint: ...
    def geom(self, number: int) -> _Named: ...

class _Named:
    name: str

class _Body:
    mocapid: Ints

class _Joint:
    qposadr: Ints

class MjsGeom:
    name: str
    meshname: str
    size: ArrayLike
    friction: ArrayLike
    solref: ArrayLike
    solimp: Floats
    condim: int

class MjsJoint:
    armature: float

class MjsActuator:
    def set_to_position(self, kp: float, kv: float) -> None: ...

class MjsBody:
    mocap: bool
    mass: float
    ipos: ArrayLike
    inertia: ArrayLike
    explicitinertial: bool
    def add_body(self, *, name: str, pos: ArrayLike, quat: ArrayLike = ...) -> MjsBody: ...
    def add_freejoint(self, *, name: str) -> MjsJoint: ...
    def add_joint(self, *, name: str, type: mjtJoint, axis: ArrayLike) -> MjsJoint: ...
    def add_geom(
        self,
        *,
        name: str,
        type: mjtGeom,
        pos: ArrayLike = ...,
        quat: ArrayLike = ...,
        size: ArrayLike = ...,
        friction: ArrayLike = ...,
        mass: float = ...,
        priority: int = ...,
    ) -> MjsGeom: ...

class MjsDefault:
    geom: MjsGeom

class MjSpec:
    option: _Option
    default: MjsDefault
    worldbody: MjsBody
    def add_mesh(
        self, *, name: str, uservert: ArrayLike, inertia: mjtMeshInertia, maxhullvert: int
    ) -> None: ...
    def add_actuator(self, *, name: str, trntype: mjtTrn, target: str) -> MjsActuator: ...
    def compile(self) -> MjModel: ...

class _Contacts:
    geom: Ints
    frame: Floats
    dim: Ints
    efc_address: Ints
    def __len__(self) -> int: ...

class _WarningStat:
    number: int

class MjData:
    def __init__(self, model: MjModel) -> None: ...
    mocap_pos: Floats
    mocap_quat: Floats
    efc_aref: Floats
    contact: _Contacts
    warning: list[_WarningStat]
    time: float
    qpos: Floats
    qvel: Floats
    ctrl: Floats
    xpos: Floats
    xquat: Floats
    xmat: Floats
    geom_xpos: Floats
    geom_xmat: Floats
    site_xpos: Floats
    site_xmat: Floats
    cam_xpos: Floats
    cam_xmat: Floats
    flexvert_xpos: Floats
    light_xpos: Floats
    xaxis: Floats
    subtree_com: Floats
    light_xdir: Floats

def mj_id2name(m: MjModel, type: int, id: int) -> str | None: ...
def mj_name2id(m: MjModel, type: int, name: str) -> int: ...
def mj_resetDataKeyframe(m: MjModel, d: MjData, key: int) -> None: ...
def mj_forward(m: MjModel, d: MjData) -> None: ...
def mj_step(m: MjModel, d: MjData, nstep: int = 1) -> None: ...
def mj_step1(m: MjModel, d: MjData) -> None: ...
def mj_step2(m: MjModel, d: MjData) -> None: ...
def mj_kinematics(m: MjModel, d: MjData) -> None: ...
def mj_comPos(m: MjModel, d: MjData) -> None: ...
def mj_camlight(m: MjModel, d: MjData) -> None: ...
def mj_flex(m: MjModel, d: MjData) -> None: ...
def set_mju_user_warning(handler: Callable[[str], None] | None) -> None: ...
def get_mju_user_warning() -> Callable[[str], None] | None: ...
def mj_ray(
    m: MjModel,
    d: MjData,
    pnt: Floats,
    vec: Floats,
    geomgroup: NDArray[np.uint8] | None,
    flg_static: int,
    bodyexclude: int,
    geomid: Ints,
    normal: Floats | None = None,
) -> float: ...
