//! `lunette compare`: methods against the path-traced reference, in the middles of triangles and in a picture.

use std::time::Instant;

use anyhow::{Context, Result, anyhow, ensure};
use lunette_bake::{Basis, Options, PortalOptions};
use lunette_relight::asset::Asset;
use lunette_relight::frame::Method;
use lunette_relight::light::Light;
use lunette_render::{ReferenceImage, ReferenceOptions, Scale, Tracer};
use lunette_scenes::{Portal, Scene};

use crate::engine::Engine;
use crate::judge::{self, Judge};
use crate::progress::say;
use crate::{args, bake, glossy, light, output, portals, relight, render, scene, stage};

/// What is compared where nothing else is asked for.
const UNDER_THE_SKY: [&str; 5] = ["bent", "aperture", "sh3", "sh5", "sh10"];
pub const INSIDE: [&str; 4] = ["sh5", "sh10", "portal-sh4", "portal-d2i"];
/// Without a bounce.
const INSIDE_DIRECT: [&str; 3] = ["sh5", "sh10", "portal"];

/// What a name on the command line means.
#[derive(Clone, Copy)]
pub enum Candidate {
    /// The sky as one shell, plain precomputed radiance transfer.
    Sky(Method),
    /// Portals, bounced light as both carriers, chosen by the light.
    Portal,
    /// Portals, bounced light as SH of this order, or of the one that holds enough of the energy.
    PortalSh(Option<usize>),
    /// Portals, bounced light from direct light.
    PortalDirectToIndirect,
}

/// After as many bounces a hundredth or less is left of the light of most rooms.
pub const ALL_BOUNCES: usize = 12;

/// `lunette compare`
pub fn run(arguments: &args::Compare) -> Result<()> {
    let is_new = !arguments.output.exists();
    output::make_folder(&arguments.output)?;
    let result = compare(arguments);
    if result.is_err() && is_new {
        // Only where it is still empty.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    result
}

fn compare(arguments: &args::Compare) -> Result<()> {
    let effort = bake::options(vec![Basis::Sh], &arguments.effort);
    effort.check().map_err(|e| anyhow!("{e}"))?;
    let portal_options = portals::options(&arguments.portals, arguments.effort.order)?;
    let samples = render::options(arguments.samples, effort.bounces as u32, 1)?;
    render::options(arguments.picture_samples, 0, 1).context("--picture-samples")?;
    ensure!(arguments.every > 0, "--every: 0 is no step; give 1 or more");
    let exposure = stage::exposure(&arguments.picture)?;
    stage::size(&arguments.picture)?;
    let asked = candidates(&arguments.methods)?;
    let mut scene = scene::load(&arguments.scene, &arguments.read)?;
    let portals = portals::take(&mut scene, &arguments.scene, &arguments.portals.openings)?;
    portals::refine(&mut scene, &portals, arguments.portals.refine)?;
    let default: &[&str] = match (portals.is_empty(), effort.bounces) {
        (true, _) => &UNDER_THE_SKY,
        (false, 0) => &INSIDE_DIRECT,
        (false, _) => &INSIDE,
    };
    let default: Vec<String> = default.iter().map(|m| m.to_string()).collect();
    let candidates = if asked.is_empty() { candidates(&default)? } else { asked };
    if portals.is_empty()
        && let Some((name, _)) = candidates.iter().find(|(_, c)| !matches!(c, Candidate::Sky(_)))
    {
        anyhow::bail!(
            "--methods: {name} needs portals; name them with --portal, or let `lunette portals` find them"
        );
    }
    let is_bounced = |c: &Candidate| matches!(c, Candidate::PortalSh(_) | Candidate::PortalDirectToIndirect);
    if effort.bounces == 0
        && let Some((name, _)) = candidates.iter().find(|(_, c)| is_bounced(c))
    {
        anyhow::bail!(
            "--methods: {name} says how light bounces, of which --bounces 0 leaves none; give portal"
        );
    }
    let follows_all = |c: &Candidate| matches!(c, Candidate::Portal | Candidate::PortalDirectToIndirect);
    if (1..ALL_BOUNCES).contains(&effort.bounces)
        && let Some((name, _)) = candidates.iter().find(|(_, c)| follows_all(c))
    {
        say(&format!(
            "{name}: light carried from direct light bounces without end, the reference's {} times, and the rest counts as \
             error; give --bounces {ALL_BOUNCES} or more",
            effort.bounces
        ));
    }
    let mut lights = light::frames(&arguments.light, scene.mesh.bounds())?;
    ensure!(lights.len() == 1, "compare takes one light, not a day; give --light sky:azimuth,elevation");
    let (_, light) = lights.remove(0);
    let folder = &arguments.output;

    let albedo = scene.vertex_albedo();
    let surface = render::surface(&scene, &albedo);
    let coat = glossy::Coat::new(&scene, &arguments.scene);
    let tracer = render::tracer(surface, &portals)?.with_gloss(coat.gloss()).map_err(|e| anyhow!("{e}"))?;
    let visibility = stage::visibility(&arguments.picture, surface)?;
    let judge = Judge::new(&scene, &tracer, &light, &samples, arguments.every, &portals)?;
    let truth = truth(arguments, &tracer, &light, &samples)?;
    output::picture(&folder.join("reference.png"), &truth.image, exposure)?;

    let coverage = visibility.coverage();
    let noise = lunette_render::noise(&truth.error.pixels, &truth.image.pixels, Some(&coverage))
        .map_err(|e| anyhow!("{e}"))?;
    let work = Work { scene: &scene, portals: &portals, effort: &effort, portal_options: &portal_options };
    let mut rows = Vec::new();
    for (name, candidate) in candidates {
        let started = Instant::now();
        let asset = work.bake(candidate)?;
        let seconds = started.elapsed().as_secs_f64();
        // Through the file's bytes, so that what is judged is what is stored.
        let bytes = asset.to_bytes().map_err(|e| anyhow!("{e}"))?;
        let asset = Asset::from_bytes(&bytes).map_err(|e| anyhow!("{e}"))?;
        let mut engine = engine(&asset, candidate)?;
        let (mut row, total) = judge::measure(&asset, (&name, &mut engine), seconds, &light, &judge)?;
        let picture = glossy::shade(&mut engine, &visibility, &surface, &total, &light)?;
        output::picture(&folder.join(format!("{name}.png")), &picture, exposure)?;
        let error = lunette_render::error_picture(&picture, &truth.image, Some(&coverage), Scale::default())
            .map_err(|e| anyhow!("{e}"))?;
        lunette_render::write_png(&folder.join(format!("{name}-error.png")), &error)
            .map_err(|e| anyhow!("{e}"))?;
        let difference = lunette_render::difference(&picture.pixels, &truth.image.pixels, Some(&coverage))
            .map_err(|e| anyhow!("{e}"))?;
        row.picture = Some((difference.relative, noise));
        if !row.is_judged() {
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

/// The path-traced picture.
fn truth(
    arguments: &args::Compare,
    tracer: &Tracer,
    light: &Light,
    options: &ReferenceOptions,
) -> Result<ReferenceImage> {
    let options = ReferenceOptions { samples: arguments.picture_samples, ..*options };
    let camera = stage::camera(&arguments.picture, tracer)?;
    let size = stage::size(&arguments.picture)?;
    render::image(tracer, light, &camera, size, &options)
}

/// What the names mean.
pub fn candidates(names: &[String]) -> Result<Vec<(String, Candidate)>> {
    names.iter().map(|name| Ok((name.clone(), candidate(name).context("--methods")?))).collect()
}

fn candidate(name: &str) -> Result<Candidate> {
    let portal = match name.strip_prefix("portal") {
        None => return relight::method(name).map(Candidate::Sky),
        Some(portal) => portal,
    };
    let order = |digits: &str| digits.parse().ok().filter(|n| (1..=10).contains(n));
    match (portal, portal.strip_prefix("-sh").and_then(order)) {
        ("", _) => Ok(Candidate::Portal),
        ("-d2i", _) => Ok(Candidate::PortalDirectToIndirect),
        (_, Some(order)) => Ok(Candidate::PortalSh(Some(order))),
        ("-sh", _) => Ok(Candidate::PortalSh(None)),
        _ => anyhow::bail!(
            "there is no method '{name}'; with portals there are portal, portal-sh (as --order says), portal-sh1 to portal-sh10, portal-d2i"
        ),
    }
}

/// The engine by which a candidate's asset is lit.
pub fn engine<'a>(asset: &'a Asset<'a>, candidate: Candidate) -> Result<Engine<'a>> {
    let inside =
        |indirect: Option<&str>| args::Outside { indirect: indirect.map(String::from), ..Default::default() };
    match candidate {
        Candidate::Sky(method) => Engine::new(asset, Some(method), &inside(None)),
        Candidate::Portal => Engine::new(asset, None, &inside(None)),
        Candidate::PortalSh(_) => Engine::new(asset, None, &inside(Some("sh"))),
        Candidate::PortalDirectToIndirect => Engine::new(asset, None, &inside(Some("direct-to-indirect"))),
    }
}

/// What every bake needs.
pub struct Work<'a> {
    pub scene: &'a Scene,
    pub portals: &'a [Portal],
    pub effort: &'a Options,
    pub portal_options: &'a PortalOptions,
}

impl Work<'_> {
    /// Bakes what a candidate needs, and no more.
    pub fn bake(&self, candidate: Candidate) -> Result<Asset<'static>> {
        let inside = |order: usize, carried: &[Basis]| {
            let basis = [&[Basis::Haar], carried].concat();
            let options = Options { basis, order: 10, indirect_order: order, ..self.effort.clone() };
            let energy_share = match candidate {
                Candidate::PortalSh(Some(_)) => None,
                _ => self.portal_options.energy_share,
            };
            let portal_options = PortalOptions { energy_share, ..*self.portal_options };
            bake::bake_portals(self.scene, self.portals, "", &options, &portal_options)
        };
        let order = self.effort.indirect_order;
        match candidate {
            Candidate::Sky(method) => bake::bake(self.scene, "", &options_of(method, self.effort)),
            Candidate::Portal => inside(order, &[Basis::Sh, Basis::DirectToIndirect]),
            Candidate::PortalSh(Some(order)) => inside(order, &[Basis::Sh]),
            Candidate::PortalSh(None) => inside(10, &[Basis::Sh]),
            Candidate::PortalDirectToIndirect => inside(order, &[Basis::DirectToIndirect]),
        }
    }
}

/// What must be baked for a method. Bounced light needs the SH pass, or comes from direct light where that is sharp.
fn options_of(method: Method, effort: &Options) -> Options {
    let (basis, order) = match method {
        Method::Bent => (vec![Basis::Bent, Basis::Sh], effort.order),
        Method::Aperture(_) => (vec![Basis::Aperture, Basis::Sh], effort.order),
        Method::Sh { order, .. } => (vec![Basis::Sh], order),
        _ => (vec![Basis::Haar, Basis::DirectToIndirect], effort.order),
    };
    let keep = |b: &Basis| effort.bounces > 0 || *b != Basis::Sh || basis.len() == 1;
    let basis = basis.iter().copied().filter(keep).collect();
    let indirect_order = effort.indirect_order.min(order);
    Options { basis, order, indirect_order, ..effort.clone() }
}
