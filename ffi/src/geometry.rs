//! Geometry on its way into a scene, and the checks on what goes into it.

use std::ffi::{c_int, c_void};

use crate::device::Device;
use crate::error::Error;
use crate::raw;
use crate::scene::{MAX_COORDINATE, Transform};

/// A geometry until it is attached: gives this side's reference back when dropped.
pub(crate) struct Geometry {
    pub device: Device,
    pub handle: *mut raw::GeometryTy,
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: the handle came from rtcNewGeometry and this is its only release.
        unsafe { (self.device.functions().release_geometry)(self.handle) }
    }
}

impl Geometry {
    /// `kind` is one of `raw::GEOMETRY_TYPE_…`.
    pub fn new(device: &Device, kind: c_int) -> Result<Geometry, Error> {
        // SAFETY: the device is alive and the kind is a value of Embree's enum.
        let handle = unsafe { (device.functions().new_geometry)(device.handle(), kind) };
        if handle.is_null() {
            device.check("make a geometry")?;
            return Err(lost_handle("make a geometry"));
        }
        Ok(Geometry { device: device.clone(), handle })
    }

    /// Copies triples into a buffer that Embree allocates, and pads as its 16-byte reads
    /// past the last element need it.
    pub fn copy_buffer<T: Copy>(&self, slot: c_int, format: c_int, triples: &[[T; 3]]) -> Result<(), Error> {
        const { assert!(size_of::<T>() == 4, "the formats in use are of 32-bit elements") };
        let functions = self.device.functions();
        // SAFETY: the geometry is alive and not yet committed; stride and count are those
        // of the slice, and a multiple of four, as rtcSetNewGeometryBuffer asks.
        let buffer = unsafe {
            let stride = size_of::<[T; 3]>();
            (functions.set_new_geometry_buffer)(self.handle, slot, 0, format, stride, triples.len())
        };
        if buffer.is_null() {
            self.device.check("allocate a mesh")?;
            return Err(lost_handle("allocate a mesh"));
        }
        // SAFETY: Embree has just allocated at least stride * count bytes there, aligned
        // to 16, which nobody else knows of yet.
        unsafe { std::ptr::copy_nonoverlapping(triples.as_ptr(), buffer.cast::<[T; 3]>(), triples.len()) };
        Ok(())
    }
}

/// Sets an instance's transform; the geometry still has to be committed.
///
/// # Safety
/// `handle` is a live instance geometry of the library that `functions` come from.
pub(crate) unsafe fn set_transform(
    functions: &raw::Functions,
    handle: *mut raw::GeometryTy,
    local_to_world: &Transform,
) {
    let rows = std::ptr::from_ref(local_to_world).cast::<c_void>();
    // SAFETY: the caller vouches for the handle; the matrix is 3 rows of 4 floats, as the
    // format says, and is copied.
    unsafe { (functions.set_geometry_transform)(handle, 0, raw::FORMAT_FLOAT3X4_ROW_MAJOR, rows) }
}

/// For a null handle without an error code, which Embree does not document.
pub(crate) fn lost_handle(action: &'static str) -> Error {
    Error::Embree { action, code: raw::ERROR_NONE, message: "no handle came back".to_owned() }
}

/// Checks what Embree takes on trust.
pub(crate) fn check_mesh(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Result<(), Error> {
    if indices.is_empty() {
        return Err(Error::NoTriangles);
    }
    // NaN compares false, so it is not within the limit.
    let is_good = |position: &[f32; 3]| position.iter().all(|x| x.abs() <= MAX_COORDINATE);
    if let Some(vertex) = positions.iter().position(|position| !is_good(position)) {
        return Err(Error::BadPosition { vertex, position: positions[vertex] });
    }
    let n_vertices = positions.len();
    for (triangle, corners) in indices.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&index| index as usize >= n_vertices) {
            return Err(Error::IndexOutOfRange { triangle, index, n_vertices });
        }
    }
    Ok(())
}

pub(crate) fn check_transform(transform: &Transform) -> Result<(), Error> {
    let is_finite = transform.iter().flatten().all(|x| x.abs() <= MAX_COORDINATE);
    let determinant = f64::from(transform[0][0]) * cofactor(transform, 0, 0)
        + f64::from(transform[0][1]) * cofactor(transform, 0, 1)
        + f64::from(transform[0][2]) * cofactor(transform, 0, 2);
    // Embree traces with the inverse, in single precision.
    let is_invertible = (determinant as f32).recip().is_finite();
    if is_finite && is_invertible { Ok(()) } else { Err(Error::BadTransform) }
}

/// (M p1 - M p0) x (M p2 - M p0) from (p1 - p0) x (p2 - p0): by the cofactors of M, which
/// for a rotation are M itself.
pub(crate) fn transform_normal(transform: &Transform, normal: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|row| {
        let sum: f64 =
            (0..3).map(|column| cofactor(transform, row, column) * f64::from(normal[column])).sum();
        sum as f32
    })
}

/// The cofactor of one element of the left 3 x 3 part.
fn cofactor(m: &Transform, row: usize, column: usize) -> f64 {
    // Cyclic neighbours carry the sign.
    let (r1, r2) = ((row + 1) % 3, (row + 2) % 3);
    let (c1, c2) = ((column + 1) % 3, (column + 2) % 3);
    let at = |r: usize, c: usize| f64::from(m[r][c]);
    at(r1, c1) * at(r2, c2) - at(r1, c2) * at(r2, c1)
}
