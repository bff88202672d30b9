//! The sun and sky of a date and a place.

use anyhow::{Context, Result, bail, ensure};
use chrono::{DateTime, Duration, FixedOffset, NaiveDate};
use lunette_relight::light::{Light, Sky, Source};
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};

/// `frames` equal steps through the 24 hours of a date, from midnight of mean solar time on, each with its label.
pub fn skies(date: &str, place: &str, frames: usize, turbidity: f32) -> Result<Vec<(String, Light)>> {
    ensure!((1..=100_000).contains(&frames), "--frames: {frames} is not in 1..=100000");
    let date: NaiveDate =
        date.parse().with_context(|| format!("--day: '{date}' is not a date like 2026-06-21"))?;
    let location = location(place)?;
    let midnight = mean_solar_midnight(date, location.longitude)?;
    let positions = SolarPositions::new();
    let delta = delta_t::estimate_from_date_like(&midnight).context("--day: too far from today")?;
    (0..frames)
        .map(|i| {
            let time = midnight + Duration::milliseconds(86_400_000 * i as i64 / frames as i64);
            let sun = positions
                .at(&time, location, 0.0, delta, Some(RefractionCorrection::standard()))
                .context("--day: the sun's position")?;
            let (azimuth, elevation) = (sun.azimuth(), sun.elevation_angle());
            let sky = Sky::new((azimuth as f32).to_radians(), (elevation as f32).to_radians(), turbidity)
                .context("--turbidity")?;
            let label = format!(
                "{} solar time, sun at {azimuth:.1}, {elevation:.1} degrees",
                time.time().format("%H:%M")
            );
            Ok((label, Light::new(Source::Sky(sky))))
        })
        .collect()
}

fn location(place: &str) -> Result<Location> {
    let numbers: Vec<f64> = place.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    match numbers[..] {
        [latitude, longitude] if latitude.abs() <= 90.0 && longitude.abs() <= 180.0 => {
            Ok(Location { latitude, longitude })
        }
        _ => bail!("--at: '{place}' is not LATITUDE,LONGITUDE in degrees, like 46.2,-122.2"),
    }
}

/// Midnight at the place by a clock that moves four minutes per degree of longitude.
fn mean_solar_midnight(date: NaiveDate, longitude: f64) -> Result<DateTime<FixedOffset>> {
    let zone = FixedOffset::east_opt((longitude * 240.0) as i32).context("--at: longitude out of range")?;
    let midnight = date.and_hms_opt(0, 0, 0).context("--day: no midnight")?;
    midnight.and_local_timezone(zone).single().context("--day: no such time")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noon_of_midsummer_stands_where_the_almanac_has_it() {
        // Mount St Helens: 90 - 46.2 + 23.44 degrees high, due south; the equation of time is under two minutes.
        let frames = skies("2026-06-21", "46.2,-122.2", 24, 3.0).unwrap();
        let Source::Sky(sky) = &frames[12].1.sources[0] else { panic!("no sky") };
        assert!((sky.elevation().to_degrees() - 67.24).abs() < 0.1, "{}", sky.elevation().to_degrees());
        assert!((sky.azimuth().to_degrees() - 180.0).abs() < 2.0, "{}", sky.azimuth().to_degrees());
        assert!(frames[0].1.sources.iter().all(|s| matches!(s, Source::Sky(sky) if sky.elevation() < 0.0)));
    }

    #[test]
    fn wrong_dates_and_places_are_named() {
        for (date, place, needle) in [("2026-02-30", "0,0", "2026-02-30"), ("2026-06-21", "91,0", "91,0")] {
            let error = format!("{:#}", skies(date, place, 24, 3.0).unwrap_err());
            assert!(error.contains(needle) && !error.contains('\n'), "{error}");
        }
    }
}
