//! The lobes of a model: its BRDF in the plane of incidence, drawn around the point of incidence.

use std::f64::consts::PI;
use std::fmt::Write;

use crate::error::Result;
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, cartesian};
use ndarray::ArrayView1;

/// Angles of the light in degrees, with the colour of each lobe.
const LIGHTS: [(f64, &str); 3] = [(10.0, "#7fb4d8"), (40.0, "#e6a857"), (70.0, "#d97a7a")];
/// Half the width of the drawing, and the radius of the largest value.
const RADIUS: f64 = 200.0;

/// An SVG of the lobes for light from three angles, on the left of the normal; the radius is the
/// value relative to the largest, as luminance.
pub(super) fn draw(brdf: &dyn Brdf) -> Result<String> {
    // Up to next to the horizon on both sides.
    let degrees: Vec<f64> = (-178..=178).map(|half| f64::from(half) / 2.0).collect();
    let mut lobes = Vec::new();
    for (light, color) in LIGHTS {
        lobes.push((light, color, luminances(brdf, light, &degrees)?));
    }
    let most = lobes
        .iter()
        .flat_map(|(_, _, values)| values)
        .fold(f64::MIN_POSITIVE, |most, &value| most.max(value));
    let point = |angle: f64, radius: f64| {
        let (sin, cos) = angle.to_radians().sin_cos();
        format!("{:.1},{:.1}", radius * sin, -radius * cos)
    };
    let width = RADIUS + 24.0;
    let mut svg = format!(
        "<svg viewBox='{} {} {} {}' role='img' \
         aria-label='Lobes' font-family='sans-serif' font-size='12'>",
        -width,
        -width,
        2.0 * width,
        width + 12.0
    );
    // Writing to a string cannot fail.
    for part in [0.5, 1.0] {
        let r = part * RADIUS;
        let _ = write!(
            svg,
            "<path d='M{},0A{r},{r} 0 0 1 {r},0' fill='none' stroke='#3a3d46'/>\
             <text x='{}' y='10' text-anchor='middle' fill='#8d8a85'>{:.2}</text>",
            -r,
            r,
            part * most
        );
    }
    let _ = write!(
        svg,
        "<path d='M{0},0H{1}M0,0V{0}' stroke='#3a3d46' fill='none'/>",
        -RADIUS, RADIUS
    );
    for (light, color, values) in &lobes {
        let points: Vec<String> = degrees
            .iter()
            .zip(values)
            .map(|(&angle, value)| point(angle, RADIUS * value / most))
            .collect();
        let _ = write!(
            svg,
            "<path d='M0,0L{}' stroke='{color}' stroke-dasharray='3 4'/>\
             <text x='0' y='0' transform='translate({})' text-anchor='middle' \
             fill='{color}'>{light}°</text>\
             <path d='M0,0L{}Z' fill='{color}' fill-opacity='0.13' stroke='{color}' \
             stroke-width='1.6' stroke-linejoin='round'/>",
            point(-light, RADIUS),
            point(-light, RADIUS + 11.0),
            points.join("L")
        );
    }
    svg.push_str("</svg>");
    Ok(svg)
}

/// The luminance that each viewer sees, both in degrees; negative ones are on the side of the light.
fn luminances(brdf: &dyn Brdf, light: f64, viewers: &[f64]) -> Result<Vec<f64>> {
    let pair = |viewer: &f64| DirectionPair {
        incident: cartesian(light.to_radians(), PI),
        outgoing: cartesian(
            viewer.abs().to_radians(),
            if *viewer < 0.0 { PI } else { 0.0 },
        ),
    };
    let pairs: Vec<DirectionPair> = viewers.iter().map(pair).collect();
    let values = brdf.eval(&pairs)?;
    let luminance = |row: ArrayView1<'_, f64>| match row.len() {
        3 => 0.2126 * row[0] + 0.7152 * row[1] + 0.0722 * row[2],
        _ => row[0],
    };
    let luminances = values.rows().into_iter().map(luminance);
    Ok(luminances.map(|value| value.max(0.0)).collect())
}
