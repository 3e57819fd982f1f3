//! Files: round trips, and every way in which one can be wrong.

use elm::persist::{self, Error};
use elm::solve::Ridge;
use elm::{Accumulator, Activation, Elm, ElmParams, NeuronGroup, NodeType};
use ndarray::{Array2, s};

fn data() -> (Array2<f64>, Array2<f64>) {
    let x = Array2::from_shape_fn((30, 3), |(i, j)| ((i * (j + 2)) as f64 * 0.37).sin());
    let t = Array2::from_shape_fn((30, 2), |(i, j)| x[[i, j]] * x[[i, 2]] + 0.1);
    (x, t)
}

/// Neurons of three kinds in one layer.
fn mixed() -> ElmParams<f64> {
    ElmParams::new(5)
        .with_group(NeuronGroup::new(4, Activation::Sine))
        .with_group(NeuronGroup::rbf(3))
}

fn models() -> Vec<Elm<f64>> {
    let (x, t) = data();
    Activation::BUILT_IN
        .into_iter()
        .map(|activation| ElmParams::new(12).with_activation(activation))
        .chain([
            ElmParams::new(5).with_direct_links(true),
            ElmParams::new(5).with_standardize(false),
            mixed(),
        ])
        .map(|params| params.fit(&x, &t).unwrap())
        .collect()
}

#[test]
fn both_forms_give_back_the_same_network_bit_for_bit() {
    let (x, _) = data();
    for model in models() {
        let bytes = persist::to_bytes(&model).unwrap();
        let text = persist::to_json(&model).unwrap();
        for form in [bytes.as_slice(), text.as_bytes()] {
            let again: Elm<f64> = persist::from_bytes(form).unwrap();
            assert_eq!(again, model);
            assert_eq!(again.predict(&x).unwrap(), model.predict(&x).unwrap());
        }
        assert!(bytes.len() < text.len());
    }
}

#[test]
fn single_precision_is_kept_apart_from_double() {
    let (x, t) = data();
    let (x, t) = (x.mapv(|v| v as f32), t.mapv(|v| v as f32));
    let single = ElmParams::<f32>::new(9).fit(&x, &t).unwrap();
    for form in [
        persist::to_bytes(&single).unwrap(),
        persist::to_json(&single).unwrap().into_bytes(),
    ] {
        assert_eq!(persist::from_bytes::<Elm<f32>>(&form).unwrap(), single);
        let error = persist::from_bytes::<Elm<f64>>(&form).unwrap_err();
        assert!(
            matches!(&error, Error::ScalarType { found, expected: "f64" } if found == "f32"),
            "{error}"
        );
    }
}

#[test]
fn files_are_written_whole_in_the_form_their_name_asks_for() {
    let dir = tempfile::tempdir().unwrap();
    let model = &models()[0];
    for name in ["model.json", "model.elm"] {
        let path = dir.path().join(name);
        std::fs::write(&path, "what was there before").unwrap();
        persist::save(model, &path).unwrap();
        assert_eq!(&persist::load::<Elm<f64>>(&path).unwrap(), model);
    }
    let text = std::fs::read_to_string(dir.path().join("model.json")).unwrap();
    assert!(
        text.starts_with("{\n  \"format\": \"elm model\",\n  \"version\": 4,"),
        "{text:.80}"
    );
    assert_eq!(
        std::fs::read_dir(dir.path()).unwrap().count(),
        2,
        "nothing is left behind"
    );

    let nowhere = dir.path().join("no/such/folder/model.elm");
    let error = persist::save(model, &nowhere).unwrap_err();
    assert!(
        matches!(
            error,
            Error::Io {
                action: "write",
                ..
            }
        ),
        "{error}"
    );
    let error = persist::load::<Elm<f64>>(&nowhere).unwrap_err();
    assert!(matches!(error, Error::Io { action: "read", .. }), "{error}");
}

#[test]
fn what_is_wrong_with_a_file_is_said_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.elm");
    std::fs::write(&path, b"elmfile").unwrap();
    let error = persist::load::<Elm<f64>>(&path).unwrap_err().to_string();
    let expected = "short.elm: the file is cut short: 7 bytes after byte 0, expected 8";
    assert!(error.ends_with(expected), "{error}");
}

#[test]
fn an_accumulator_goes_on_where_its_file_left_off() {
    let (x, t) = data();
    let params = ElmParams::new(8).with_solver(Ridge::relative(1e-6));
    let mut whole = Accumulator::from_sample(&params, &x, 2).unwrap();
    let mut parts = whole.clone();
    whole.push(&x, &t).unwrap();
    parts
        .push(&x.slice(s![..11, ..]), &t.slice(s![..11, ..]))
        .unwrap();
    let bytes = persist::to_bytes(&parts).unwrap();
    let mut parts: Accumulator<f64> = persist::from_bytes(&bytes).unwrap();
    parts
        .push(&x.slice(s![11.., ..]), &t.slice(s![11.., ..]))
        .unwrap();
    assert_eq!(parts.fit().unwrap(), whole.fit().unwrap());
    let error = persist::from_bytes::<Elm<f64>>(&bytes).unwrap_err();
    assert!(matches!(error, Error::Kind { .. }), "{error}");
}

#[test]
fn a_custom_activation_is_refused_by_name() {
    let (x, t) = data();
    let cube = Activation::custom("cube", |z: f64| z * z * z);
    for params in [
        ElmParams::new(4).with_activation(cube.clone()),
        mixed().with_group(NeuronGroup::new(2, cube).with_node_type(NodeType::Rbf)),
    ] {
        let model = params.fit(&x, &t).unwrap();
        for error in [
            persist::to_bytes(&model).unwrap_err(),
            persist::to_json(&model).unwrap_err(),
        ] {
            assert!(
                matches!(&error, Error::CustomActivation { name } if name == "cube"),
                "{error}"
            );
        }
    }
}

#[test]
fn each_kind_of_damage_has_its_own_error() {
    let bytes = persist::to_bytes(&models()[0]).unwrap();
    let refuse = |bytes: &[u8]| persist::from_bytes::<Elm<f64>>(bytes).unwrap_err();
    let with = |at: usize, value: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = value;
        bytes
    };
    let empty = refuse(b"").to_string();
    assert_eq!(
        empty,
        "the file is cut short: 0 bytes after byte 0, expected 8"
    );
    assert!(matches!(refuse(b"%PDF-1.7 and so on"), Error::Foreign));
    assert!(matches!(
        refuse(&with(8, 5)),
        Error::Future {
            found: 5,
            supported: 4
        }
    ));
    assert!(matches!(
        refuse(&with(8, 3)),
        Error::Past {
            found: 3,
            supported: 4
        }
    ));
    assert!(matches!(refuse(&with(13, b'E')), Error::Kind { .. }));
    let last = bytes.len() - 1;
    assert!(matches!(
        refuse(&with(last, bytes[last] ^ 1)),
        Error::Checksum { .. }
    ));
    assert!(matches!(refuse(&bytes[..last]), Error::Length { .. }));
    assert!(matches!(
        refuse(&[bytes.as_slice(), b"x"].concat()),
        Error::Length { .. }
    ));
    assert!(matches!(refuse(b"{\"format\": 3}"), Error::Contents { .. }));
}

#[test]
fn a_file_that_contradicts_itself_is_refused() {
    // Valid JSON by a hostile hand: sizes that do not fit together, values that are not finite,
    // and a length that no memory could hold.
    let text = persist::to_json(&mixed().fit(&data().0, &data().1).unwrap()).unwrap();
    let scales =
        |scales: &[f64]| serde_json::json!({"v": 1, "dim": [scales.len()], "data": scales});
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mutate = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = value.clone();
        change(&mut value["contents"]);
        persist::from_bytes::<Elm<f64>>(value.to_string().as_bytes())
            .unwrap_err()
            .to_string()
    };
    let huge = serde_json::json!([1u64 << 40, 1u64 << 40]);
    for error in [
        mutate(&|c| c["intercept"]["data"] = serde_json::json!([0.0])),
        mutate(&|c| c["intercept"] = serde_json::json!({"v": 1, "dim": [1], "data": [0.0]})),
        mutate(&|c| c["beta"]["dim"] = huge.clone()),
        mutate(&|c| c["beta"] = serde_json::json!({"v": 1, "dim": [1, 2], "data": [0.0, 0.0]})),
        mutate(&|c| {
            c["map"]["scaler"]["mean"] = serde_json::json!({"v": 1, "dim": [1], "data": [0.0]});
        }),
        mutate(&|c| c["beta"]["data"][0] = serde_json::json!(null)),
        mutate(&|c| c["map"]["layer"]["groups"][0]["activation"] = serde_json::json!("cube")),
        mutate(&|c| c["map"]["layer"]["groups"][1]["neurons"] = serde_json::json!(5)),
        mutate(&|c| c["map"]["layer"]["groups"][1]["neurons"] = serde_json::json!(u64::MAX)),
        mutate(&|c| c["map"]["layer"]["groups"] = serde_json::json!([])),
        mutate(&|c| c["map"]["layer"]["groups"][2]["radial"]["dim"] = serde_json::json!([2])),
        mutate(&|c| c["map"]["layer"]["groups"][0]["radial"] = scales(&[0.5, 1.0])),
        mutate(&|c| c["map"]["layer"]["groups"][2]["radial"]["data"][1] = serde_json::json!(null)),
        mutate(&|c| c["map"]["direct_links"] = serde_json::json!(true)),
    ] {
        assert!(
            error.starts_with("the file holds no sound elm model"),
            "{error}"
        );
    }
}

#[test]
fn a_fit_at_the_end_of_the_range_survives_json() {
    // The norm of forty residuals as large as these is infinite.
    let x = Array2::from_shape_fn((40, 1), |(row, _)| row as f64);
    let t = Array2::from_shape_fn(
        (40, 1),
        |(row, _)| if row % 2 == 0 { 4e307 } else { -4e307 },
    );
    let model = ElmParams::new(1)
        .with_solver(Ridge::relative(1e3))
        .fit(&x, &t)
        .unwrap();
    assert_eq!(model.diagnosis().residual_norm, [f64::MAX]);
    let text = persist::to_json(&model).unwrap();
    let again: Elm<f64> = persist::from_bytes(text.as_bytes()).unwrap();
    assert_eq!(again, model);
}

#[test]
fn json_is_read_as_editors_leave_it() {
    let model = &models()[0];
    let text = persist::to_json(model).unwrap();
    for before in ["", " ", "\n\t\r\n", "\u{feff}", "\u{feff}\r\n "] {
        let again: Elm<f64> = persist::from_bytes(format!("{before}{text}\n ").as_bytes()).unwrap();
        assert_eq!(&again, model);
    }
    for foreign in ["\u{feff}", "  elm", "\u{feff}[]"] {
        let error = persist::from_bytes::<Elm<f64>>(foreign.as_bytes()).unwrap_err();
        assert!(matches!(error, Error::Foreign), "{foreign:?}: {error}");
    }
}

#[test]
fn of_a_folder_that_is_not_there_its_name_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("no");
    let path = missing.join("such/model.elm");
    let error = persist::save(&models()[0], &path).unwrap_err().to_string();
    let expected = format!("the folder {} does not exist", missing.display());
    assert!(error.ends_with(&expected), "{error}");
    assert!(
        !error.contains("tmp-") && !error.contains("elm-tmp"),
        "{error}"
    );
}

#[cfg(unix)]
#[test]
fn a_private_file_stays_private_and_a_link_stays_a_link() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let dir = tempfile::tempdir().unwrap();
    let (file, link) = (dir.path().join("model.elm"), dir.path().join("latest.elm"));
    persist::save(&models()[0], &file).unwrap();
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).unwrap();
    symlink("model.elm", &link).unwrap();
    persist::save(&models()[1], &link).unwrap();
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    let mode = std::fs::metadata(&file).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    assert_eq!(persist::load::<Elm<f64>>(&file).unwrap(), models()[1]);
}
