//! Reflectance in the plane of incidence, as polar curves with the measurements on them.

use std::f64::consts::{FRAC_PI_2, PI};

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{BLUE, Chart, Drawn, GRAY, GREEN, PALE, Panel, VERMILION, round_step, titled};
use crate::error::Result;
use elm_datasets::geometry::{DirectionPair, cartesian};

/// Angles of the light that are drawn, in degrees.
const LIGHTS: [(f64, RGBColor); 3] = [(22.5, BLUE), (45.0, GREEN), (67.5, VERMILION)];
/// How far from these a measurement's light may be, in degrees.
const NEAR: f64 = 1.5;
/// How far from the plane of incidence its viewer may be, as the sine of the angle.
const OFF_PLANE: f64 = 0.05;
/// Number of the viewer's angles of a curve, from horizon to horizon.
const STEPS: usize = 181;

const PANEL: (u32, u32) = (400, 236);

/// A place in 1/sr: x along the surface, away from the light, y along the normal.
type Place = (f64, f64);

struct Drawing {
    name: String,
    /// One entry per angle of the light: the model's curve, and measurements.
    lobes: Vec<(Vec<Place>, Vec<Place>)>,
}

pub(super) struct Lobes {
    title: String,
    panels: Vec<Drawing>,
}

impl Lobes {
    pub(super) fn new(title: &str, panels: &[Panel<'_>]) -> Result<Self> {
        Ok(Self {
            title: title.to_owned(),
            panels: panels.iter().map(Drawing::new).collect::<Result<_>>()?,
        })
    }

    fn columns(&self) -> usize {
        self.panels.len().clamp(1, 3)
    }
}

impl Drawing {
    fn new(panel: &Panel<'_>) -> Result<Self> {
        let lobes = LIGHTS
            .iter()
            .map(|&(light, _)| Ok((curve(panel, light.to_radians())?, measured(panel, light))));
        Ok(Self {
            name: panel.name.clone(),
            lobes: lobes.collect::<Result<_>>()?,
        })
    }
}

/// The model's values for viewers from the light's side of the horizon to the other.
fn curve(panel: &Panel<'_>, theta_i: f64) -> Result<Vec<Place>> {
    let angles = (1..STEPS).map(|step| step as f64 / STEPS as f64 * PI - FRAC_PI_2);
    let angles: Vec<f64> = angles.collect();
    let pairs: Vec<DirectionPair> = angles
        .iter()
        .map(|&angle| DirectionPair {
            // The light comes from the left.
            incident: cartesian(theta_i, PI),
            outgoing: cartesian(angle.abs(), if angle < 0.0 { PI } else { 0.0 }),
        })
        .collect();
    let values = panel.model.eval(&pairs)?;
    let count = panel.channels.len().max(1) as f64;
    let mean = |row: usize| {
        let channels = panel.channels.clone();
        channels.filter_map(|c| values.get((row, c))).sum::<f64>() / count
    };
    let places = angles.iter().enumerate();
    Ok(places
        .map(|(row, angle)| (mean(row) * angle.sin(), mean(row) * angle.cos()))
        .collect())
}

/// The measurements in the plane of incidence, for this angle of the light in degrees.
fn measured(panel: &Panel<'_>, light: f64) -> Vec<Place> {
    let rows = panel.pairs.iter().zip(panel.measured.rows());
    rows.filter_map(|(pair, values)| {
        let [x, y, z] = pair.incident;
        let plane = x.hypot(y);
        if (plane.atan2(z).to_degrees() - light).abs() > NEAR {
            return None;
        }
        let [u, v, w] = pair.outgoing;
        let (across, along) = ((v * x - u * y) / plane, -(u * x + v * y) / plane);
        if across.abs() > OFF_PLANE || w <= 0.0 {
            return None;
        }
        let value = values.mean()?;
        let length = along.hypot(w);
        Some((value * along / length, value * w / length))
    })
    .collect()
}

impl Chart for Lobes {
    fn size(&self) -> (u32, u32) {
        let columns = self.columns();
        let rows = self.panels.len().div_ceil(columns).max(1);
        (
            (PANEL.0 * columns as u32).max(760),
            110 + PANEL.1 * rows as u32,
        )
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let what = "Reflectance in the plane of incidence (1/sr), light from the left";
        let area = titled(area, what, &self.title)?;
        let text = ("sans-serif", 13).into_text_style(&area);
        let text = text.pos(Pos::new(HPos::Left, VPos::Center));
        let mut x = 14;
        for (light, color) in LIGHTS {
            area.draw(&PathElement::new(
                [(x, 12), (x + 24, 12)],
                color.stroke_width(2),
            ))?;
            area.draw_text(&format!("light at {light} degrees"), &text, (x + 30, 12))?;
            x += 190;
        }
        area.draw(&Circle::new((x + 4, 12), 4, BLACK.filled()))?;
        area.draw_text("measured", &text, (x + 14, 12))?;
        let area = area.margin(36, 8, 0, 0);
        let columns = self.columns();
        let rows = self.panels.len().div_ceil(columns).max(1);
        for (panel, cell) in self.panels.iter().zip(area.split_evenly((rows, columns))) {
            panel.draw(&cell)?;
        }
        Ok(())
    }
}

impl Drawing {
    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let (width, height) = area.dim_in_pixel();
        let (middle, ground) = (width as i32 / 2, height as i32 - 24);
        let radius = f64::from((middle - 30).min(ground - 34));
        let all = self
            .lobes
            .iter()
            .flat_map(|(curve, points)| curve.iter().chain(points));
        let most = all.map(|&(x, y)| x.hypot(y)).filter(|r| r.is_finite());
        let most = most.fold(0.0, f64::max);
        let most = if most > 0.0 { 1.05 * most } else { 1.0 };
        let pixel = |(x, y): Place| {
            (
                middle + (x / most * radius) as i32,
                ground - (y / most * radius) as i32,
            )
        };
        let small = ("sans-serif", 11).into_text_style(area).color(&GRAY);
        let centered = small.pos(Pos::new(HPos::Center, VPos::Top));
        let arc = |r: f64| {
            (0..=60)
                .map(move |s| PI * f64::from(s) / 60.0)
                .map(move |a| (r * a.cos(), r * a.sin()))
        };
        let step = round_step(2.0 * most);
        for ring in (1..=10)
            .map(|ring| f64::from(ring) * step)
            .filter(|&r| r <= most)
        {
            let line: Vec<_> = arc(ring).map(pixel).collect();
            area.draw(&PathElement::new(line, PALE))?;
            let decimals = (-step.log10().floor()).max(0.0) as usize;
            let (x, y) = pixel((ring, 0.0));
            area.draw_text(&format!("{ring:.decimals$}"), &centered, (x, y + 4))?;
        }
        for degrees in [-60, -30, 0, 30, 60] {
            let angle = f64::from(degrees).to_radians();
            let end = (most * angle.sin(), most * angle.cos());
            area.draw(&PathElement::new([pixel((0.0, 0.0)), pixel(end)], PALE))?;
            let (x, y) = pixel((1.06 * end.0, 1.06 * end.1));
            let label = small.pos(Pos::new(HPos::Center, VPos::Center));
            area.draw_text(&format!("{degrees}"), &label, (x, y))?;
        }
        area.draw(&PathElement::new(
            [pixel((-most, 0.0)), pixel((most, 0.0))],
            GRAY,
        ))?;
        for ((curve, points), (light, color)) in self.lobes.iter().zip(LIGHTS) {
            let line: Vec<_> = curve.iter().copied().map(pixel).collect();
            area.draw(&PathElement::new(line, color.stroke_width(2)))?;
            for &point in points {
                area.draw(&Circle::new(pixel(point), 4, color.filled()))?;
            }
            // Where the light stands.
            let angle = light.to_radians();
            let ray = |r: f64| pixel((-r * most * angle.sin(), r * most * angle.cos()));
            area.draw(&PathElement::new(
                [ray(0.9), ray(1.0)],
                color.stroke_width(4),
            ))?;
        }
        area.draw_text(
            &self.name,
            &("sans-serif", 14).into_text_style(area),
            (8, 2),
        )
    }
}
