//! `lunette relight`

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::Vec3;
use lunette_relight::aperture::Intersection;
use lunette_relight::asset::Asset;
use lunette_relight::frame::Method;
use lunette_relight::light::{Light, Window};
use lunette_render::{Exposure, auto_exposure};

use crate::args;
use crate::engine::{Engine, Evaluated};
use crate::moving::{Lit, MOST_FRAMES, Moving, Studio};
use crate::output;
use crate::progress::say;
use crate::{light, stage};

/// `lunette relight`
pub fn run(arguments: &args::Relight) -> Result<()> {
    let kind = output::kind(&arguments.output)?;
    output::check_folder(&arguments.output)?;
    let bytes = map(&arguments.file)?;
    let asset = open(&arguments.file, &bytes)?;
    let method = match &arguments.method {
        Some(name) => Some(method(name).context("--method")?),
        None => best_method(&asset),
    };
    let mut engine = Engine::new(&asset, method, &arguments.outside)
        .with_context(|| arguments.file.display().to_string())?;
    let moving = Moving::new(&arguments.moving)?;
    let mut lights = light::frames(&arguments.light, bounds(&asset))?;
    if lights.len() == 1 && (arguments.outside.along.is_some() || moving.moves()) {
        let n = arguments.light.frames;
        ensure!((1..=MOST_FRAMES).contains(&n), "--frames: {n} is not in 1..={MOST_FRAMES}");
        lights = vec![lights.remove(0); n];
    }
    let n = lights.len();
    let mut exposure = stage::exposure(&arguments.picture)?;
    let mut studio = match kind.is_picture() {
        true => Some(Studio::new(&asset, &moving, &arguments.picture)?),
        false => None,
    };
    moving.check(&asset, studio.as_ref().map(Studio::eye), n)?;
    if let Some(products) = &arguments.moving.products {
        check_products(products, &moving, studio.as_ref(), n)?;
    }
    moving.report();
    warn_of_portals(&asset, &moving);
    for (i, (label, light)) in lights.iter().enumerate() {
        let path = output::frame_path(&arguments.output, i, n)?;
        let moment = moving.at(i, n);
        let mut seen = String::new();
        let Evaluated { direct, indirect, products, spent } = engine.light(&asset, light, &moment, (i, n))?;
        if let Some(studio) = &mut studio {
            let total = sum(&direct, &indirect);
            warn_of_ringing(&total);
            let started = Instant::now();
            let through = engine.through(&total);
            if let Some(glossy) = through.and_then(|through| through.glossy) {
                let milliseconds = started.elapsed().as_secs_f64() * 1e3;
                seen = format!(", what {} glossy ones see in {milliseconds:.2} ms", glossy.vertices().len());
            }
            let lit = Lit { light, through, total: &total, products: &products, frame: (i, n) };
            let image = studio.shoot(&moment, &lit)?;
            if let Some(pattern) = &arguments.moving.products {
                let picture = studio.products(&moment, &lit)?;
                let path = output::frame_path(pattern, i, n)?;
                lunette_render::write_png(&path, &picture).map_err(|e| anyhow!("{e}"))?;
            }
            if n > 1 && exposure == Exposure::Auto {
                exposure = Exposure::Stops(middle_exposure(&mut engine, &lights, &asset, &moving, studio)?);
            }
            output::picture(&path, &image, exposure)?;
        } else {
            let lit = output::Lit { direct: &direct, indirect: &indirect, error: None };
            output::vertices(&path, &asset, &lit)?;
        }
        let label = if label.is_empty() { String::new() } else { format!(", {label}") };
        let [project, dot, lobes] = [spent.project, spent.dot, spent.moving].map(|d| d.as_secs_f64() * 1e3);
        let lamps = match moment.is_empty() {
            true => String::new(),
            false => format!(", {} in {lobes:.2} ms", moment.describe(&products)),
        };
        println!(
            "{}: light projected in {project:.2} ms, {} vertices relit in {dot:.2} ms{seen}{lamps}{label}",
            path.display(),
            asset.n_vertices()
        );
    }
    Ok(())
}

/// That a picture of products can be made, and written where it is asked for.
fn check_products(path: &Path, moving: &Moving, studio: Option<&Studio>, n: usize) -> Result<()> {
    ensure!(
        output::kind(path)? == output::Kind::Png,
        "--products: {}: the ending must be .png",
        path.display()
    );
    ensure!(studio.is_some(), "--products: needs a picture as output, .png or .exr");
    ensure!(!moving.is_empty(), "--products: needs a --lamp, whose products it counts");
    output::frame_path(path, 0, n)?;
    output::check_folder(path)
}

/// Portals know nothing of blockers.
fn warn_of_portals(asset: &Asset, moving: &Moving) {
    if asset.metadata.shells.len() > 1 && !moving.at(0, 1).blockers().is_empty() {
        say("blockers shadow the lamps; they do not shadow what comes through the portals");
    }
}

/// One exposure for all frames: that of the middle one, of a day noon.
fn middle_exposure(
    engine: &mut Engine,
    lights: &[(String, Light)],
    asset: &Asset,
    moving: &Moving,
    studio: &mut Studio,
) -> Result<f32> {
    let n = lights.len();
    let (middle, (_, light)) = (n / 2, &lights[n / 2]);
    let moment = moving.at(middle, n);
    let Evaluated { direct, indirect, products, .. } = engine.light(asset, light, &moment, (middle, n))?;
    let total = sum(&direct, &indirect);
    let through = engine.through(&total);
    let lit = Lit { light, through, total: &total, products: &products, frame: (middle, n) };
    Ok(auto_exposure(&studio.shoot(&moment, &lit)?))
}

/// Both together.
pub fn sum(direct: &[[f32; 3]], indirect: &[[f32; 3]]) -> Vec<[f32; 3]> {
    direct.iter().zip(indirect).map(|(d, i)| [d[0] + i[0], d[1] + i[1], d[2] + i[2]]).collect()
}

/// Negative light is a sign of too few bands for the light.
fn warn_of_ringing(irradiance: &[[f32; 3]]) {
    let sum = |sign: f32| irradiance.iter().flatten().map(|e| (e * sign).max(0.0) as f64).sum::<f64>();
    let share = sum(-1.0) / sum(1.0).max(f64::MIN_POSITIVE);
    if share > 0.01 {
        say(&format!(
            "{:.1} % of the light is negative: SH of this order rings under so small a light; use aperture, a window (sh-lanczos), or more bands",
            share * 100.0
        ));
    }
}

/// The method that a name means.
pub fn method(name: &str) -> Result<Method> {
    let (base, window) = match name.strip_suffix("-lanczos") {
        Some(base) => (base, Some(Window::Lanczos { strength: 1.0 })),
        None => (name, None),
    };
    match (base, window) {
        ("bent", None) => return Ok(Method::Bent),
        ("aperture", None) => return Ok(Method::Aperture(Intersection::Exact)),
        ("haar", None) => return Ok(Method::Haar),
        ("aperture-smooth", None) => return Ok(Method::Aperture(Intersection::Smoothstep)),
        _ => {}
    }
    let order = match base.strip_prefix("sh") {
        Some("") => Some(10),
        Some(digits) => digits.parse().ok().filter(|n| (1..=10).contains(n)),
        None => None,
    };
    match order {
        Some(order) => Ok(Method::Sh { order, window }),
        None => bail!(
            "there is no method '{name}'; there are bent, aperture, aperture-smooth, haar, sh, sh1 to sh10, and -lanczos after sh"
        ),
    }
}

/// What the asset holds of the sky; nothing for an interior.
fn best_method(asset: &Asset) -> Option<Method> {
    let has = |name| asset.tensor(name).is_some();
    if asset.metadata.shells.len() > 1 {
        None
    } else if has("sky.direct.start") {
        Some(Method::Haar)
    } else if has("sky.direct.sh") {
        Some(Method::default())
    } else if has("sky.aperture") {
        Some(Method::Aperture(Intersection::Exact))
    } else {
        Some(Method::Bent)
    }
}

/// The file's bytes, mapped.
pub fn map(path: &Path) -> Result<memmap2::Mmap> {
    let file = std::fs::File::open(path).with_context(|| path.display().to_string())?;
    let mapped = map_file(&file);
    mapped.with_context(|| format!("{}: cannot be read", path.display()))
}

#[allow(unsafe_code, reason = "mapping a file is unsafe by nature")]
fn map_file(file: &std::fs::File) -> std::io::Result<memmap2::Mmap> {
    // SAFETY: the mapping is read-only. Lunette replaces files by renaming, never by writing into them, so that the
    // bytes under the mapping stay as they are unless another program truncates the file meanwhile.
    unsafe { memmap2::Mmap::map(file) }
}

/// The asset in the bytes.
pub fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Asset<'a>> {
    Asset::from_bytes(bytes).map_err(|e| anyhow!("{}: {e}", path.display()))
}

/// Smallest and largest corner of an asset's mesh.
fn bounds(asset: &Asset) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    asset.positions().iter().fold(start, |(lo, hi), &p| (lo.min(p.into()), hi.max(p.into())))
}
