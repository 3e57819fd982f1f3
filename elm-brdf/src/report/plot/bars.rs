//! Each material's error beside the paper's and the noise floor.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{BLUE, Chart, Drawn, ORANGE, PALE, PredictionPlot, round_step, titled};

/// Height of a material's bars in pixels.
const ROW: u32 = 30;
const LEFT: i32 = 190;
const RIGHT: i32 = 70;
const TOP: i32 = 40;
const WIDTH: u32 = 900;

struct Row {
    name: String,
    rmse: f64,
    paper: Option<f64>,
    noise_floor: Option<f64>,
}

pub(super) struct Bars {
    title: String,
    rows: Vec<Row>,
}

impl Bars {
    pub(super) fn new(title: &str, materials: &[PredictionPlot<'_>]) -> Self {
        let rows = materials.iter().map(|material| Row {
            name: material.name.clone(),
            rmse: material.rmse,
            paper: material.paper,
            noise_floor: material.noise_floor,
        });
        Self {
            title: title.to_owned(),
            rows: rows.collect(),
        }
    }
}

impl Chart for Bars {
    fn size(&self) -> (u32, u32) {
        (
            WIDTH,
            60 + TOP as u32 + ROW * self.rows.len().max(1) as u32 + 60,
        )
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let area = titled(area, "Held-out error of each material", &self.title)?;
        let (width, height) = area.dim_in_pixel();
        let (width, bottom) = (width as i32, height as i32 - 50);
        let rows = self.rows.iter();
        let values = rows.flat_map(|row| [Some(row.rmse), row.paper, row.noise_floor]);
        let most = values
            .flatten()
            .filter(|v| v.is_finite())
            .fold(0.0, f64::max);
        let most = if most > 0.0 { most } else { 1.0 };
        let place = |value: f64| {
            let share = (value / most).clamp(0.0, 1.0);
            LEFT + (share * f64::from(width - LEFT - RIGHT)) as i32
        };
        let text = ("sans-serif", 13).into_text_style(&area);
        let centered = text.pos(Pos::new(HPos::Center, VPos::Top));
        let step = round_step(most);
        for tick in (0..=10)
            .map(|tick| f64::from(tick) * step)
            .filter(|&t| t <= most)
        {
            let x = place(tick);
            area.draw(&PathElement::new([(x, TOP), (x, bottom)], PALE))?;
            let decimals = (-step.log10().floor()).max(0.0) as usize;
            area.draw_text(&format!("{tick:.decimals$}"), &centered, (x, bottom + 6))?;
        }
        let middle = (LEFT + width - RIGHT) / 2;
        let label = ("sans-serif", 15).into_text_style(&area);
        let label = label.pos(Pos::new(HPos::Center, VPos::Top));
        area.draw_text(
            "root mean squared error (1/sr)",
            &label,
            (middle, bottom + 26),
        )?;
        self.legend(&area)?;
        let names = text.pos(Pos::new(HPos::Right, VPos::Center));
        let figures = text.pos(Pos::new(HPos::Left, VPos::Center));
        for (index, row) in self.rows.iter().enumerate() {
            let y = TOP + index as i32 * ROW as i32;
            area.draw_text(&row.name, &names, (LEFT - 8, y + 13))?;
            let bar = |value: f64, top: i32, bottom: i32, color: RGBColor| {
                Rectangle::new(
                    [(LEFT, y + top), (place(value), y + bottom)],
                    color.filled(),
                )
            };
            area.draw(&bar(row.rmse, 4, 14, BLUE))?;
            if let Some(paper) = row.paper {
                area.draw(&bar(paper, 15, 24, ORANGE))?;
            }
            let end = row.paper.map_or(row.rmse, |paper| paper.max(row.rmse));
            let figure = row.paper.map_or_else(
                || format!("{:.4}", row.rmse),
                |paper| format!("{:.2} x", row.rmse / paper),
            );
            let after = row.noise_floor.map_or(end, |floor| floor.max(end));
            area.draw_text(&figure, &figures, (place(after) + 6, y + 13))?;
            if let Some(floor) = row.noise_floor {
                let x = place(floor);
                let line = [(x, y + 1), (x, y + 27)];
                area.draw(&PathElement::new(line, BLACK.stroke_width(2)))?;
            }
        }
        Ok(())
    }
}

impl Bars {
    fn legend<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let text = ("sans-serif", 13).into_text_style(area);
        let text = text.pos(Pos::new(HPos::Left, VPos::Center));
        let mut x = LEFT;
        let mut say = |label: &str, color: Option<RGBColor>| -> Drawn<DB> {
            match color {
                Some(color) => {
                    let square = [(x, 8), (x + 14, 20)];
                    area.draw(&Rectangle::new(square, color.filled()))?;
                }
                None => {
                    let line = [(x + 7, 4), (x + 7, 24)];
                    area.draw(&PathElement::new(line, BLACK.stroke_width(2)))?;
                }
            }
            area.draw_text(label, &text, (x + 20, 14))?;
            x += 60 + 8 * label.len() as i32;
            Ok(())
        };
        say("held out", Some(BLUE))?;
        if self.rows.iter().any(|row| row.paper.is_some()) {
            say("printed in the paper", Some(ORANGE))?;
        }
        if self.rows.iter().any(|row| row.noise_floor.is_some()) {
            say("noise floor", None)?;
        }
        Ok(())
    }
}
