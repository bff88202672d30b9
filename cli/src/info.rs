//! `lunette info`

use anyhow::{Result, anyhow};
use lunette_relight::glossy::Glossy;

use crate::args;
use crate::relight::{map, open};

/// `lunette info`
pub fn run(arguments: &args::Info) -> Result<()> {
    let bytes = map(&arguments.file)?;
    let asset = open(&arguments.file, &bytes)?;
    let m = &asset.metadata;
    println!(
        "{}: baked from {} (scene {}) by {}, format version {}",
        arguments.file.display(),
        m.scene,
        m.scene_hash,
        m.tool,
        m.version
    );
    println!(
        "{} vertices, {} triangles, {:.1} MB",
        asset.n_vertices(),
        asset.triangles().len(),
        bytes.len() as f64 / 1e6
    );
    let options: Vec<String> = m.options.iter().map(|(k, v)| format!("{k} {v}")).collect();
    println!("options: {}, seed {}", options.join(", "), m.seed);
    for shell in &m.shells {
        println!("shell {}{}", shell.name, shell.area.map(|a| format!(", {a:.2} m²")).unwrap_or_default());
    }
    if let Some(glossy) = Glossy::open(&asset).map_err(|e| anyhow!("{e}"))? {
        let (texels, patches) = glossy.entries_per_vertex();
        println!(
            "{} glossy vertices, {:.0} bytes each beside their direct rows; a view reads {texels:.0} texels and \
             {patches:.0} patches for each",
            glossy.vertices().len(),
            glossy.bytes_per_vertex()
        );
    }
    println!("{:<24} {:>6} {:>20} {:>10} {:>10}", "tensor", "type", "shape", "bytes/V", "scale");
    for (name, tensor) in asset.tensors() {
        let per_vertex = tensor.data.bytes().len() as f64 / asset.n_vertices().max(1) as f64;
        let shape = format!("{:?}", tensor.shape);
        println!(
            "{name:<24} {:>6} {shape:>20} {per_vertex:>10.1} {:>10}",
            format!("{:?}", tensor.data.dtype()),
            m.scale(name)
        );
    }
    Ok(())
}
