//! Short ways to bake and relight.

use glam::Vec3;
use lunette_bake::{Options, Silent, bake};
use lunette_relight::asset::Asset;
use lunette_relight::frame::{Frame, Method};
use lunette_relight::light::{Light, ParseContext};
use lunette_scenes::{Scene, builtin};

/// A built-in scene by its spec.
///
/// # Panics
/// When there is no such scene.
pub fn scene(spec: &str) -> Scene {
    builtin::build(spec).expect("a built-in scene")
}

/// A light by its spec, without pictures.
///
/// # Panics
/// When the spec is wrong.
pub fn light(spec: &str) -> Light {
    let mut no_pictures = |_: &std::path::Path| Err("no pictures here".to_string());
    Light::parse(spec, &mut ParseContext::new(&mut no_pictures)).expect("a light")
}

/// The bake of a scene.
///
/// # Panics
/// When it fails.
pub fn baked(scene: &Scene, options: &Options) -> Asset<'static> {
    bake(scene, options, &Silent).expect("a bake")
}

/// Direct light only.
pub fn direct_only() -> Options {
    Options { bounces: 0, ..Options::default() }
}

/// Direct and bounced irradiance of every vertex.
///
/// # Panics
/// When the asset lacks what the method needs.
pub fn irradiance(asset: &Asset, light: &Light, method: Method) -> Vec<Vec3> {
    let mut frame = Frame::new(asset, method).expect("what the method needs");
    frame.project(light);
    let mut out = vec![[0.0; 3]; asset.n_vertices()];
    frame.direct(0, &mut out);
    frame.add_indirect(0, &mut out);
    out.into_iter().map(Vec3::from).collect()
}

/// The values meant by row `v` of an f16 tensor.
///
/// # Panics
/// When there is no such tensor or row.
pub fn row(asset: &Asset, tensor: &str, v: usize) -> Vec<f32> {
    let (values, scale) = asset.half(tensor).expect("an f16 tensor");
    let width = values.len() / asset.n_vertices();
    values[v * width..][..width].iter().map(|x| x.to_f32() * scale).collect()
}
