//! `lunette compare`: methods against the path-traced reference, at the vertices.

use std::time::Instant;

use anyhow::{Context, Result, anyhow, ensure};
use lunette_bake::{Basis, Options};
use lunette_relight::asset::Asset;
use lunette_relight::frame::Method;
use lunette_render::{Scale, Tracer};

use crate::judge::{self, Judge};
use crate::progress::say;
use crate::{args, bake, light, output, relight, render, scene, stage};

/// `lunette compare`
pub fn run(arguments: &args::Compare) -> Result<()> {
    let methods: Vec<(&str, Method)> = arguments
        .methods
        .iter()
        .map(|m| Ok((m.as_str(), relight::method(m).context("--methods")?)))
        .collect::<Result<_>>()?;
    let effort = bake::options(&["sh".into()], &arguments.effort)?;
    effort.check().map_err(|e| anyhow!("{e}"))?;
    let samples = render::options(arguments.samples, effort.bounces as u32, 1)?;
    let exposure = stage::exposure(&arguments.picture)?;
    stage::size(&arguments.picture)?;
    let scene = scene::load(&arguments.scene, &arguments.read)?;
    let mut lights = light::frames(&arguments.light, scene.mesh.bounds())?;
    ensure!(lights.len() == 1, "compare takes one light, not a day; give --light sky:azimuth,elevation");
    let (_, light) = lights.remove(0);
    let folder = &arguments.output;
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;

    let albedo = scene.vertex_albedo();
    let surface = render::surface(&scene, &albedo);
    let tracer = Tracer::new(surface).map_err(|e| anyhow!("{e}"))?;
    let visibility = stage::visibility(&arguments.picture, surface)?;
    let judge = Judge::new(&scene, &tracer, &light, &samples, 1)?;
    let truth = stage::shade(&visibility, &surface, bytemuck::cast_slice(&judge.reference), &light)?;
    output::picture(&folder.join("reference.png"), &truth, exposure)?;

    let coverage = visibility.coverage();
    let mut rows = Vec::new();
    for (name, method) in methods {
        let started = Instant::now();
        let asset = bake::bake(&scene, "", &options_of(method, &effort))?;
        let seconds = started.elapsed().as_secs_f64();
        // Through the file's bytes, so that what is judged is what is stored.
        let bytes = asset.to_bytes().map_err(|e| anyhow!("{e}"))?;
        let asset = Asset::from_bytes(&bytes).map_err(|e| anyhow!("{e}"))?;
        let (row, total) = judge::measure(&asset, (name, method), seconds, &light, &judge)?;
        let picture = stage::shade(&visibility, &surface, &total, &light)?;
        output::picture(&folder.join(format!("{name}.png")), &picture, exposure)?;
        let error = lunette_render::error_picture(&picture, &truth, Some(&coverage), Scale::default())
            .map_err(|e| anyhow!("{e}"))?;
        lunette_render::write_png(&folder.join(format!("{name}-error.png")), &error)
            .map_err(|e| anyhow!("{e}"))?;
        if !row.is_judged {
            say(&format!(
                "{name}: the reference is too noisy to judge so small an error; give more --samples"
            ));
        }
        rows.push(row);
    }
    let text = judge::table(&rows, &judge);
    lunette_render::write_atomically(&folder.join("table.txt"), text.as_bytes())
        .map_err(|e| anyhow!("{e}"))?;
    print!("{text}");
    Ok(())
}

/// What must be baked for a method. Bounced light needs the SH pass, whatever carries the direct light.
fn options_of(method: Method, effort: &Options) -> Options {
    let (basis, order) = match method {
        Method::Bent => (vec![Basis::Bent], effort.order),
        Method::Aperture(_) => (vec![Basis::Aperture], effort.order),
        Method::Sh { order, .. } => (vec![Basis::Sh], order),
        _ => (vec![Basis::Sh], effort.order),
    };
    let sh = if effort.bounces > 0 && !basis.contains(&Basis::Sh) { vec![Basis::Sh] } else { vec![] };
    let indirect_order = effort.indirect_order.min(order);
    Options { basis: [basis, sh].concat(), order, indirect_order, ..effort.clone() }
}
