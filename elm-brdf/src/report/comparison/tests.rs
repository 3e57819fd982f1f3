//! Tables of a comparison.

use super::*;
use crate::baselines::Analytic;
use crate::protocol::{Folds, cross_validate};
use elm_datasets::{Invalid, MaterialId, synthetic};

fn comparison() -> Comparison {
    let ids = [1, 39].map(|n| MaterialId::new(n).unwrap());
    let data = synthetic::measurements(1, &ids, Invalid::Clamp);
    let folds = Folds::new(data.directions.len(), 5, 1).unwrap();
    let mut first = Vec::new();
    let entries = [Analytic::Lambert, Analytic::GgxOrenNayar].map(|model| {
        let scores = cross_validate(&model, &data, &folds, |_, _| {}).unwrap();
        first = scores.clone();
        let words = ModelLabel {
            model: model.name().to_owned(),
            features: None,
            target: None,
            network: model == Analytic::Lambert,
        };
        Entry::new(words, &data.channels, false, &[scores])
    });
    let data = Data::of("synthetic".to_owned(), &data, &first);
    Comparison::new(data, 5, 1, 1, entries.to_vec(), 0.5)
}

#[test]
fn the_model_with_the_smaller_error_comes_first_in_every_form() {
    let comparison = comparison();
    // The synthetic data has highlights, which a constant misses.
    assert_eq!(comparison.models[0].model, "ggx+oren-nayar");
    for format in Format::ALL {
        let text = comparison.render(format).unwrap();
        let place = |name: &str| text.find(name).unwrap();
        assert!(place("ggx+oren-nayar") < place("lambert"), "{text}");
        assert!(text.ends_with('\n'));
    }
}

#[test]
fn whoever_has_the_smallest_error_wins_and_references_that_beat_a_network_are_named() {
    let comparison = comparison();
    let wins: Vec<usize> = comparison.models.iter().map(|entry| entry.wins).collect();
    // Two materials of three channels.
    assert_eq!(wins.iter().sum::<usize>(), 6);
    let text = comparison.render(Format::Table).unwrap();
    let said = format!("smaller RMSE for {} of 6:", wins[0]);
    assert!(
        text.contains(&said) && text.contains("ggx+oren-nayar: 1 red ("),
        "{text}"
    );
}

#[test]
fn json_is_read_back() {
    let comparison = comparison();
    let text = comparison.render(Format::Json).unwrap();
    assert_eq!(
        serde_json::from_str::<Comparison>(&text).unwrap(),
        comparison
    );
}

#[test]
fn the_synthetic_data_is_never_compared_with_the_paper() {
    let comparison = comparison();
    assert!(
        comparison
            .models
            .iter()
            .all(|m| m.rmse_ratio_to_paper.is_none())
    );
    let text = comparison.render(Format::Table).unwrap();
    assert!(
        text.contains("SYNTHETIC") && !text.contains("printed"),
        "{text}"
    );
}
