//! The paper's Tables I to III as printed: 15 of CUReT's 61 materials in Table I, 13 of them in
//! Tables II and III.
//!
//! S. Kartal, *Extreme Learning Machine based Bidirectional Reflectance Distribution
//! Approximation*, International Journal of Advanced Research in Computer Science and Software
//! Engineering 7(3), 2017.

use elm_datasets::MaterialId;

/// What the paper prints for one material; red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Printed {
    /// CUReT's number of the material.
    pub id: usize,
    /// The material's name as the paper spells it.
    pub name: &'static str,
    /// Table I, root mean squared error in 1/sr.
    pub rmse: [f64; 3],
    /// Table II, mean absolute error in 1/sr; its last two rows are missing in print.
    pub mae: Option<[f64; 3]>,
    /// Table III, correlation; its last two rows are missing in print.
    pub correlation: Option<[f64; 3]>,
}

const fn row(
    id: usize,
    name: &'static str,
    rmse: [f64; 3],
    mae: [f64; 3],
    correlation: [f64; 3],
) -> Printed {
    Printed {
        id,
        name,
        rmse,
        mae: Some(mae),
        correlation: Some(correlation),
    }
}

/// The printed rows in the order of Table I.
#[rustfmt::skip]
pub const TABLES: [Printed; 15] = [
    row(1, "Felt", [0.0416, 0.0323, 0.0131], [0.01880, 0.0142, 0.0063], [0.9696, 0.9717, 0.9747]),
    row(2, "Polyester", [0.0271, 0.0212, 0.0101], [0.0115, 0.0089, 0.0044], [0.9810, 0.9795, 0.9827]),
    row(9, "Frosted Glass", [0.0692, 0.0458, 0.0214], [0.0314, 0.0211, 0.0098], [0.9633, 0.9638, 0.9650]),
    row(12, "Rough Paper", [0.0344, 0.0225, 0.0099], [0.0160, 0.0104, 0.0047], [0.9817, 0.9810, 0.9813]),
    row(13, "Artificial Grass", [0.0059, 0.0051, 0.0017], [0.0029, 0.0025, 0.0008], [0.9855, 0.9847, 0.9864]),
    row(15, "Foil", [0.0702, 0.0490, 0.0230], [0.0362, 0.0253, 0.0118], [0.9274, 0.9270, 0.9289]),
    row(16, "Cork", [0.0173, 0.0174, 0.0068], [0.070, 0.0069, 0.0027], [0.9845, 0.9818, 0.9839]),
    row(21, "Sponge", [0.0135, 0.01294, 0.0053], [0.0066, 0.0058, 0.0023], [0.9906, 0.9886, 0.9894]),
    row(23, "Lettuce Leaf", [0.0316, 0.0228, 0.0113], [0.0139, 0.0102, 0.0050], [0.9358, 0.9375, 0.9416]),
    row(25, "Quarry Tile", [0.0309, 0.0301, 0.0141], [0.0134, 0.0130, 0.0059], [0.9562, 0.9516, 0.94961]),
    row(39, "Human Skin", [0.0114, 0.0091, 0.0050], [0.0053, 0.0042, 0.0023], [0.9762, 0.9744, 0.9775]),
    row(41, "Brick_b", [0.0485, 0.0378, 0.0173], [0.0205, 0.0161, 0.0072], [0.9363, 0.9355, 0.9325]),
    row(44, "Linen", [0.0298, 0.0206, 0.0080], [0.0135, 0.0094, 0.0036], [0.9754, 0.9754, 0.9758]),
    Printed { id: 46, name: "Cotton", rmse: [0.0418, 0.0306, 0.0160], mae: None, correlation: None },
    Printed { id: 55, name: "Orange Peel", rmse: [0.0483, 0.0425, 0.0260], mae: None, correlation: None },
];

/// What the paper prints for one channel of one material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Table I.
    pub rmse: f64,
    /// Table II.
    pub mae: Option<f64>,
    /// Table III.
    pub correlation: Option<f64>,
    /// The printed mean absolute error exceeds the printed root mean squared error, which no
    /// numbers can do: a misprint (Table II, row 16: 0.070, very likely 0.0070).
    pub impossible_mae: bool,
}

/// The printed figures for a material and one of the channels `red`, `green`, `blue`, or for
/// `average` the mean of the three.
///
/// That mean is a fair bound for a model of the averaged channel: by the triangle inequality the
/// RMSE (and the MAE) of an average of three predictions is at most the average of their three.
/// Correlation has no such bound; its mean is given for orientation.
#[must_use]
pub fn figures(id: MaterialId, channel: &str) -> Option<Figures> {
    let printed = TABLES.iter().find(|printed| printed.id == id.number())?;
    let impossible = |i: usize| printed.mae.is_some_and(|mae| mae[i] > printed.rmse[i]);
    let single = |i: usize| Figures {
        rmse: printed.rmse[i],
        mae: printed.mae.map(|mae| mae[i]),
        correlation: printed.correlation.map(|correlation| correlation[i]),
        impossible_mae: impossible(i),
    };
    let mean = |values: [f64; 3]| values.iter().sum::<f64>() / 3.0;
    match channel {
        "red" => Some(single(0)),
        "green" => Some(single(1)),
        "blue" => Some(single(2)),
        "average" => Some(Figures {
            rmse: mean(printed.rmse),
            mae: printed.mae.map(mean),
            correlation: printed.correlation.map(mean),
            impossible_mae: (0..3).any(impossible),
        }),
        _ => None,
    }
}

/// The materials that the paper shows, in its order.
#[must_use]
pub fn materials() -> Vec<MaterialId> {
    TABLES
        .iter()
        .filter_map(|printed| MaterialId::new(printed.id).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_only_impossible_figure_is_the_misprint_of_cork() {
        for id in materials() {
            for channel in ["red", "green", "blue"] {
                let impossible = figures(id, channel).unwrap().impossible_mae;
                assert_eq!(
                    impossible,
                    (id.number(), channel) == (16, "red"),
                    "{id:?} {channel}"
                );
            }
        }
    }

    #[test]
    fn names_agree_with_the_database() {
        for printed in TABLES {
            let id: MaterialId = printed.name.parse().unwrap();
            assert_eq!(id.number(), printed.id);
        }
        assert_eq!(materials().len(), TABLES.len());
    }

    #[test]
    fn the_average_is_the_mean_of_three() {
        let felt = figures(MaterialId::new(1).unwrap(), "average").unwrap();
        approx::assert_abs_diff_eq!(felt.rmse, 0.029, epsilon = 1e-15);
        assert_eq!(figures(MaterialId::new(3).unwrap(), "red"), None);
    }
}
