//! The Embree device: the library, opened and checked.

use std::ffi::CStr;
use std::path::Path;
use std::sync::Arc;

use crate::error::{Error, code_name};
use crate::library::{self, Embree};
use crate::raw;

/// Embree, ready for use. Cheap to clone: clones share one device.
#[derive(Clone)]
pub struct Device {
    inner: Arc<Inner>,
}

struct Inner {
    embree: Embree,
    handle: *mut raw::DeviceTy,
    version: (u32, u32, u32),
}

// SAFETY: the handle is used only through Embree's functions, which may be called from
// any thread (Embree API documentation, "Embree API": the API is thread-safe, save for
// changing one object from two threads, and nothing here changes a device).
unsafe impl Send for Inner {}
// SAFETY: as above; errors, a device's only changing state, are kept per thread.
unsafe impl Sync for Inner {}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: the handle came from rtcNewDevice and this is its only release. Scenes
        // hold a `Device` of their own, so none outlives it.
        unsafe { (self.embree.functions.release_device)(self.handle) }
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("version", &self.version()).field("library", &self.library()).finish()
    }
}

impl Device {
    /// Finds Embree 4, opens it, makes a device and checks with a few rays that the
    /// library's structures are laid out as this crate has them.
    ///
    /// # Errors
    /// One line with the remedy where no library is found, or where it cannot be loaded,
    /// is not Embree 4, or was built with other options than this crate can use.
    pub fn new() -> Result<Device, Error> {
        Device::with_library(library::open()?)
    }

    pub(crate) fn with_library(embree: Embree) -> Result<Device, Error> {
        // SAFETY: a null configuration asks for the defaults (rtcNewDevice).
        let handle = unsafe { (embree.functions.new_device)(std::ptr::null()) };
        if handle.is_null() {
            return Err(device_error(&embree, handle, "make a device"));
        }
        let version = version(&embree, handle);
        let device = Device { inner: Arc::new(Inner { embree, handle, version }) };
        if version.0 != 4 {
            return Err(Error::WrongVersion { path: device.library().to_owned(), version });
        }
        crate::probe::check(&device)?;
        Ok(device)
    }

    /// The library's version: major (4), minor, patch.
    pub fn version(&self) -> (u32, u32, u32) {
        self.inner.version
    }

    /// The library that was opened: a path, or the bare name that the system's loader
    /// resolved.
    pub fn library(&self) -> &Path {
        &self.inner.embree.path
    }

    pub(crate) fn functions(&self) -> &raw::Functions {
        &self.inner.embree.functions
    }

    pub(crate) fn handle(&self) -> *mut raw::DeviceTy {
        self.inner.handle
    }

    pub(crate) fn is_same(&self, other: &Device) -> bool {
        Arc::ptr_eq(&self.inner, &other.inner)
    }

    /// Takes this thread's pending error, if Embree has set one.
    pub(crate) fn check(&self, action: &'static str) -> Result<(), Error> {
        match device_error(&self.inner.embree, self.inner.handle, action) {
            Error::Embree { code: raw::ERROR_NONE, .. } => Ok(()),
            error => Err(error),
        }
    }
}

fn version(embree: &Embree, handle: *mut raw::DeviceTy) -> (u32, u32, u32) {
    // SAFETY: the handle is a live device, and the property numbers are those of
    // rtcGetDeviceProperty, the same in Embree 3 and 4.
    let get = |property| unsafe { (embree.functions.get_device_property)(handle, property) };
    let number = |property| u32::try_from(get(property)).unwrap_or(0);
    (
        number(raw::DEVICE_PROPERTY_VERSION_MAJOR),
        number(raw::DEVICE_PROPERTY_VERSION_MINOR),
        number(raw::DEVICE_PROPERTY_VERSION_PATCH),
    )
}

/// This thread's error as Embree tells it; a null handle asks why a device was not made.
fn device_error(embree: &Embree, handle: *mut raw::DeviceTy, action: &'static str) -> Error {
    // SAFETY: rtcGetDeviceError takes a live device or null.
    let code = unsafe { (embree.functions.get_device_error)(handle) };
    if code == raw::ERROR_NONE {
        return Error::Embree { action, code, message: String::new() };
    }
    let message = embree.functions.get_device_last_error_message.and_then(|last_error_message| {
        // SAFETY: takes a live device or null, like rtcGetDeviceError.
        let text = unsafe { last_error_message(handle) };
        // SAFETY: where it is not null, it is a NUL-terminated string that stays until
        // this thread's next call into Embree, and it is copied before that.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().replace('\n', " "))
    });
    let message = message.filter(|text| !text.is_empty()).unwrap_or_else(|| code_name(code).to_owned());
    Error::Embree { action, code, message }
}
