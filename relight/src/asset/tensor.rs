//! One named array of an asset.

use std::borrow::Cow;

use bytemuck::Pod;
use half::f16;
use safetensors::{Dtype, View, tensor::TensorView};

use super::Error;

/// An array: its shape and its values in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor<'a> {
    /// Lengths of the dimensions.
    pub shape: Vec<usize>,
    /// As many values as the product of the shape.
    pub data: Data<'a>,
}

/// Values of one of the types that an asset may hold, borrowed where possible.
#[derive(Clone, Debug, PartialEq)]
pub enum Data<'a> {
    /// Half floats.
    F16(Cow<'a, [f16]>),
    /// Floats.
    F32(Cow<'a, [f32]>),
    /// Bytes.
    U8(Cow<'a, [u8]>),
    /// Signed bytes.
    I8(Cow<'a, [i8]>),
    /// Short unsigned integers.
    U16(Cow<'a, [u16]>),
    /// Unsigned integers.
    U32(Cow<'a, [u32]>),
}

impl Data<'_> {
    /// The values, if they are bytes.
    pub(crate) fn as_u8(&self) -> Option<&[u8]> {
        if let Data::U8(values) = self { Some(values) } else { None }
    }

    /// The values, if they are short unsigned integers.
    pub(crate) fn as_u16(&self) -> Option<&[u16]> {
        if let Data::U16(values) = self { Some(values) } else { None }
    }

    /// The values, if they are unsigned integers.
    pub(crate) fn as_u32(&self) -> Option<&[u32]> {
        if let Data::U32(values) = self { Some(values) } else { None }
    }

    /// The values, if they are floats.
    pub(crate) fn as_f32(&self) -> Option<&[f32]> {
        if let Data::F32(values) = self { Some(values) } else { None }
    }
}

impl<'a> Tensor<'a> {
    pub(super) fn from_view(name: &str, view: &TensorView<'a>) -> Result<Tensor<'a>, Error> {
        let data = match view.dtype() {
            Dtype::F16 => Data::F16(cast(view.data())),
            Dtype::F32 => Data::F32(cast(view.data())),
            Dtype::U8 => Data::U8(cast(view.data())),
            Dtype::I8 => Data::I8(cast(view.data())),
            Dtype::U16 => Data::U16(cast(view.data())),
            Dtype::U32 => Data::U32(cast(view.data())),
            other => {
                let what = format!("values of type {other:?} have no place in an asset");
                return Err(Error::Tensor { name: name.to_string(), what });
            }
        };
        Ok(Tensor { shape: view.shape().to_vec(), data })
    }
}

/// The bytes as values: borrowed where they are aligned (always so at the start of a page or of an ordinary
/// allocation), copied otherwise. safetensors has checked that the length is a multiple of the size.
fn cast<T: Pod>(bytes: &[u8]) -> Cow<'_, [T]> {
    match bytemuck::try_cast_slice(bytes) {
        Ok(values) => Cow::Borrowed(values),
        Err(_) => Cow::Owned(bytemuck::allocation::pod_collect_to_vec(bytes)),
    }
}

impl Data<'_> {
    /// The safetensors type.
    pub fn dtype(&self) -> Dtype {
        match self {
            Data::F16(_) => Dtype::F16,
            Data::F32(_) => Dtype::F32,
            Data::U8(_) => Dtype::U8,
            Data::I8(_) => Dtype::I8,
            Data::U16(_) => Dtype::U16,
            Data::U32(_) => Dtype::U32,
        }
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.bytes().len() * 8 / self.dtype().bitsize()
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.bytes().is_empty()
    }

    /// The same values, for as long as they are wanted.
    pub fn into_owned(self) -> Data<'static> {
        match self {
            Data::F16(v) => Data::F16(Cow::Owned(v.into_owned())),
            Data::F32(v) => Data::F32(Cow::Owned(v.into_owned())),
            Data::U8(v) => Data::U8(Cow::Owned(v.into_owned())),
            Data::I8(v) => Data::I8(Cow::Owned(v.into_owned())),
            Data::U16(v) => Data::U16(Cow::Owned(v.into_owned())),
            Data::U32(v) => Data::U32(Cow::Owned(v.into_owned())),
        }
    }

    /// The values as they lie in the file.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Data::F16(v) => bytemuck::cast_slice(v),
            Data::F32(v) => bytemuck::cast_slice(v),
            Data::U8(v) => v,
            Data::I8(v) => bytemuck::cast_slice(v),
            Data::U16(v) => bytemuck::cast_slice(v),
            Data::U32(v) => bytemuck::cast_slice(v),
        }
    }
}

impl View for &Tensor<'_> {
    fn dtype(&self) -> Dtype {
        self.data.dtype()
    }
    fn shape(&self) -> &[usize] {
        &self.shape
    }
    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(self.data.bytes())
    }
    fn data_len(&self) -> usize {
        self.data.bytes().len()
    }
}
