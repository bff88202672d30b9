//! The run time in a program of one's own: open a bake, move a sun, fill a buffer.
//!
//!     lunette bake terrain -o terrain.safetensors
//!     cargo run --release -p lunette-relight --example embed -- terrain.safetensors

use std::time::Instant;

use lunette_relight::asset::Asset;
use lunette_relight::frame::{Frame, Method};
use lunette_relight::light::{Light, Sky, Source};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: embed FILE.safetensors")?;

    // Bytes may as well come from a memory map or an archive; the asset borrows from them.
    let bytes = std::fs::read(path)?;
    let asset = Asset::from_bytes(&bytes)?;
    let mut frame = Frame::new(&asset, Method::default())?;

    // The caller's own buffer; nothing below allocates.
    let mut irradiance = vec![[0.0f32; 3]; asset.n_vertices()];
    for hour in 6..=18 {
        let elevation = ((hour - 6) as f32 * 15.0).to_radians().sin() * 60f32.to_radians();
        let azimuth = (hour as f32 * 15.0).to_radians();
        let sky = Light::new(Source::Sky(Sky::new(azimuth, elevation, 3.0)?));

        let started = Instant::now();
        frame.project(&sky);
        // Any slice of the vertices, from any thread.
        for (part, out) in irradiance.chunks_mut(10_000).enumerate() {
            frame.direct(part * 10_000, out);
            frame.add_indirect(part * 10_000, out);
        }
        let mean = irradiance.iter().map(|e| e[1]).sum::<f32>() / irradiance.len() as f32;
        println!("{hour:2}:00  mean irradiance {mean:8.3}  in {:.2?}", started.elapsed());
    }
    Ok(())
}
