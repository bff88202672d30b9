//! Embree 4's C interface, declared by hand, as far as this crate uses it.
//!
//! Names, values and layouts follow `embree4/rtcore_*.h`. Queries
//! pass null for `RTCIntersectArguments` and `RTCOccludedArguments`, whose length depends on
//! how the library was built: null asks for the defaults, incoherent rays and no filter.
//! (The coherent hint was measured too: it is slower for occlusion in any order.)
//!
//! Limits: one instance level (`RTC_MAX_INSTANCE_LEVEL_COUNT` = 1, the default of
//! every known build). [`crate::probe`] checks a library against that before use.

use std::ffi::{c_char, c_int, c_uint, c_void};

use libloading::Library;

/// Handles are pointers to types that only the library knows.
macro_rules! opaque {
    ($($(#[$doc:meta])* $name:ident)*) => {$(
        $(#[$doc])*
        #[repr(C)]
        pub struct $name { _private: [u8; 0] }
    )*};
}

opaque! {
    /// `RTCDeviceTy`.
    DeviceTy
    /// `RTCSceneTy`.
    SceneTy
    /// `RTCGeometryTy`.
    GeometryTy
}

/// `RTC_INVALID_GEOMETRY_ID`: what the id fields hold where nothing was hit.
pub const INVALID_GEOMETRY_ID: u32 = u32::MAX;

/// `RTC_DEVICE_PROPERTY_VERSION_MAJOR`.
pub const DEVICE_PROPERTY_VERSION_MAJOR: c_int = 1;
/// `RTC_DEVICE_PROPERTY_VERSION_MINOR`.
pub const DEVICE_PROPERTY_VERSION_MINOR: c_int = 2;
/// `RTC_DEVICE_PROPERTY_VERSION_PATCH`.
pub const DEVICE_PROPERTY_VERSION_PATCH: c_int = 3;

/// `RTC_ERROR_NONE`.
pub const ERROR_NONE: c_int = 0;

/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
/// `RTC_GEOMETRY_TYPE_INSTANCE`.
pub const GEOMETRY_TYPE_INSTANCE: c_int = 121;

/// `RTC_BUFFER_TYPE_INDEX`.
pub const BUFFER_TYPE_INDEX: c_int = 0;
/// `RTC_BUFFER_TYPE_VERTEX`.
pub const BUFFER_TYPE_VERTEX: c_int = 1;

/// `RTC_FORMAT_UINT3`: three 32-bit indices, 12 bytes.
pub const FORMAT_UINT3: c_int = 0x5003;
/// `RTC_FORMAT_FLOAT3`: three 32-bit floats, 12 bytes.
pub const FORMAT_FLOAT3: c_int = 0x9003;
/// `RTC_FORMAT_FLOAT3X4_ROW_MAJOR`: three rows of four, 48 bytes.
pub const FORMAT_FLOAT3X4_ROW_MAJOR: c_int = 0x9134;

/// `RTC_BUILD_QUALITY_HIGH`: the SAH builder with spatial splits.
pub const BUILD_QUALITY_HIGH: c_int = 2;

/// `RTC_SCENE_FLAG_ROBUST`: watertight traversal and intersection.
pub const SCENE_FLAG_ROBUST: c_int = 1 << 2;

/// `RTCRay`.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: [f32; 3],
    pub tnear: f32,
    pub direction: [f32; 3],
    pub time: f32,
    pub tfar: f32,
    pub mask: u32,
    pub id: u32,
    pub flags: u32,
}

/// `RTCHit` with `instPrimID`, which libraries from 4.3 on write and earlier ones do
/// not know: being last, it moves no other field.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub normal: [f32; 3],
    pub u: f32,
    pub v: f32,
    pub primitive: u32,
    pub geometry: u32,
    pub instance: u32,
    pub instance_primitive: u32,
}

/// `RTCRayHit`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RayHit {
    pub ray: Ray,
    pub hit: Hit,
}

/// `rtcIntersect8`, `rtcIntersect16`: lane mask, scene, combined rays and hits,
/// null arguments.
pub type IntersectPacket = unsafe extern "C" fn(*const i32, *mut SceneTy, *mut c_void, *mut c_void);
/// `rtcOccluded8`, `rtcOccluded16`: lane mask, scene, rays, null arguments.
pub type OccludedPacket = unsafe extern "C" fn(*const i32, *mut SceneTy, *mut c_void, *mut c_void);

/// The table of functions, and how to fill it from a library.
macro_rules! functions {
    (
        required { $($field:ident = $symbol:literal : $type:ty;)* }
        optional { $($ofield:ident = $osymbol:literal : $otype:ty;)* }
    ) => {
        /// Every function of Embree that this crate calls.
        pub struct Functions {
            $(pub $field: $type,)*
            $(pub $ofield: Option<$otype>,)*
        }

        impl Functions {
            /// Looks every symbol up; the error is the name of the first one missing.
            ///
            /// # Safety
            /// Where the library has symbols of these names, they must be Embree 4's
            /// functions, and the library must stay loaded while the table is in use.
            pub unsafe fn load(library: &Library) -> Result<Functions, &'static str> {
                Ok(Functions {
                    // SAFETY: the types are those of Embree 4's headers, and the caller
                    // vouches that these names belong to Embree 4.
                    $($field: unsafe { library.get::<$type>($symbol) }.map(|symbol| *symbol).map_err(|_| $symbol)?,)*
                    // SAFETY: as above.
                    $($ofield: unsafe { library.get::<$otype>($osymbol) }.map(|symbol| *symbol).ok(),)*
                })
            }
        }
    };
}

functions! {
    required {
        new_device = "rtcNewDevice": unsafe extern "C" fn(*const c_char) -> *mut DeviceTy;
        release_device = "rtcReleaseDevice": unsafe extern "C" fn(*mut DeviceTy);
        get_device_property = "rtcGetDeviceProperty": unsafe extern "C" fn(*mut DeviceTy, c_int) -> isize;
        get_device_error = "rtcGetDeviceError": unsafe extern "C" fn(*mut DeviceTy) -> c_int;
        new_geometry = "rtcNewGeometry": unsafe extern "C" fn(*mut DeviceTy, c_int) -> *mut GeometryTy;
        release_geometry = "rtcReleaseGeometry": unsafe extern "C" fn(*mut GeometryTy);
        commit_geometry = "rtcCommitGeometry": unsafe extern "C" fn(*mut GeometryTy);
        set_geometry_build_quality = "rtcSetGeometryBuildQuality": unsafe extern "C" fn(*mut GeometryTy, c_int);
        set_new_geometry_buffer = "rtcSetNewGeometryBuffer":
            unsafe extern "C" fn(*mut GeometryTy, c_int, c_uint, c_int, usize, usize) -> *mut c_void;
        set_geometry_instanced_scene = "rtcSetGeometryInstancedScene":
            unsafe extern "C" fn(*mut GeometryTy, *mut SceneTy);
        set_geometry_transform = "rtcSetGeometryTransform":
            unsafe extern "C" fn(*mut GeometryTy, c_uint, c_int, *const c_void);
        new_scene = "rtcNewScene": unsafe extern "C" fn(*mut DeviceTy) -> *mut SceneTy;
        release_scene = "rtcReleaseScene": unsafe extern "C" fn(*mut SceneTy);
        set_scene_build_quality = "rtcSetSceneBuildQuality": unsafe extern "C" fn(*mut SceneTy, c_int);
        set_scene_flags = "rtcSetSceneFlags": unsafe extern "C" fn(*mut SceneTy, c_int);
        attach_geometry = "rtcAttachGeometry": unsafe extern "C" fn(*mut SceneTy, *mut GeometryTy) -> c_uint;
        get_geometry = "rtcGetGeometry": unsafe extern "C" fn(*mut SceneTy, c_uint) -> *mut GeometryTy;
        commit_scene = "rtcCommitScene": unsafe extern "C" fn(*mut SceneTy);
        intersect1 = "rtcIntersect1": unsafe extern "C" fn(*mut SceneTy, *mut RayHit, *mut c_void);
        intersect8 = "rtcIntersect8": IntersectPacket;
        intersect16 = "rtcIntersect16": IntersectPacket;
        occluded1 = "rtcOccluded1": unsafe extern "C" fn(*mut SceneTy, *mut Ray, *mut c_void);
        occluded8 = "rtcOccluded8": OccludedPacket;
        occluded16 = "rtcOccluded16": OccludedPacket;
    }
    optional {
        // Since Embree 4.3.3.
        get_device_last_error_message = "rtcGetDeviceLastErrorMessage":
            unsafe extern "C" fn(*mut DeviceTy) -> *const c_char;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::{align_of, offset_of, size_of};

    #[test]
    fn layout_matches_embree_headers() {
        assert_eq!((size_of::<Ray>(), align_of::<Ray>()), (48, 16));
        assert_eq!(offset_of!(Ray, direction), 16);
        assert_eq!(offset_of!(Ray, tfar), 32);
        assert_eq!(offset_of!(Ray, mask), 36);
        assert_eq!((size_of::<Hit>(), align_of::<Hit>()), (48, 16));
        assert_eq!(offset_of!(Hit, primitive), 20);
        assert_eq!(offset_of!(Hit, instance), 28);
        assert_eq!(offset_of!(Hit, instance_primitive), 32);
        assert_eq!(offset_of!(RayHit, hit), 48);
    }
}
