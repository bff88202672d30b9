//! Cosine lobes: the product of two against a table of it, frames a second, and error against time.
//!
//! Scenes as in Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009: a plane of
//! 4,096, 16,384 or 65,536 points under a rabbit of 64 spheres at three heights, one spherical lamp, masks of
//! depth 5; and 65,536 points of varying Lafortune materials without a blocker. Their frames a second, on a
//! 2.2 GHz Core 2 Duo, stand beside ours. Charts go to `target/lobes.html`.
//!
//!     cargo bench -p lunette-benches --bench lobes

mod curve;
mod mesh;
mod product;
mod scene;
mod speed;

use lunette_benches::chart::Page;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut page =
        Page::new("Cosine lobes", "Direct light of moving lamps past moving spheres, without a bake.");
    product::compare(&mut page)?;
    let rabbit = scene::rabbit();
    let body = rabbit.fit();
    speed::frames(&body);
    speed::materials();
    speed::shares(&body);
    curve::error_against_time(&body, &mut page)?;
    mesh::against_rays("five spheres", &mesh::five_spheres()?, None)?;
    mesh::against_rays(rabbit.name, &body, Some(&rabbit))?;
    if let Some(bunny) = scene::bunny() {
        mesh::against_rays(bunny.name, &bunny.fit(), Some(&bunny))?;
    }
    println!("charts: {}", page.write("lobes.html")?.display());
    Ok(())
}
