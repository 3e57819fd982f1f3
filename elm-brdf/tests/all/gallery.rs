//! The page that shows learnt materials, as a browser shows it.

use std::sync::LazyLock;

use elm_brdf::gallery::{self, GalleryItem, SingleMaterial, sphere};
use elm_brdf::model::BrdfModel;
use elm_brdf::recipes;
use elm_brdf::render::{Bitmap, Options, render};
use elm_datasets::{Invalid, MaterialId, synthetic};

/// Pixels across and down of what the page shows to this test.
const SIZE: usize = 64;

static ITEMS: LazyLock<Vec<GalleryItem>> = LazyLock::new(|| {
    // Rough, shiny, and in between.
    [5, 7, 61]
        .map(|id| {
            let id = MaterialId::new(id).unwrap();
            let data = synthetic::measurements(1, &[id], Invalid::Clamp);
            let samples = data.samples(0).unwrap();
            let brdf = recipes::network(None)
                .fit(&samples.directions, samples.values.view())
                .unwrap();
            GalleryItem {
                name: format!("</script> {id} & \"quoted\""),
                origin: "a test".to_owned(),
                model: BrdfModel::of(&*brdf).unwrap().clone(),
                held_out: Some(0.01),
            }
        })
        .into()
});

/// What the page says that it shows, and its pixels.
struct Shown {
    item: usize,
    light: [f64; 3],
    viewer: [f64; 3],
    up: [f64; 3],
    pixels: Vec<[u8; 4]>,
}

/// Reads `shows N light x y z viewer x y z up x y z`.
fn shown(message: &str) -> Shown {
    let words: Vec<&str> = message.split(' ').collect();
    let vector = |start: usize| [0, 1, 2].map(|c| words[start + c].parse().unwrap());
    Shown {
        item: words[1].parse().unwrap(),
        light: vector(3),
        viewer: vector(7),
        up: vector(11),
        pixels: Vec::new(),
    }
}

#[test]
fn a_gallery_is_a_page_and_a_picture_per_material_that_load_nothing_from_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let items = &*ITEMS;
    gallery::write(dir.path(), items, 32, |_| {}).unwrap();
    let index = dir.path().join("index.html");
    assert_eq!(
        std::fs::read_dir(dir.path()).unwrap().count(),
        1 + items.len()
    );
    let page = std::fs::read_to_string(&index).unwrap();
    assert!(
        !page.contains("http"),
        "the page asks for something elsewhere"
    );
}

#[test]
#[ignore = "needs Chromium"]
fn the_page_shades_its_sphere_as_the_renderer_does_and_follows_the_mouse() {
    let Some(chromium) = elm_test_support::chromium() else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let items = &*ITEMS;
    gallery::write(dir.path(), items, 32, |_| {}).unwrap();
    let index = dir.path().join("index.html");

    let mut pictures: Vec<Shown> = Vec::new();
    let mut images = None;
    for message in crate::browser::console(&chromium, &index, "#self-test", "done") {
        if message.starts_with("shows ") {
            pictures.push(shown(&message));
        } else if let Some(row) = message.strip_prefix("row ") {
            let bytes: Vec<u8> = row.split(' ').map(|b| b.parse().unwrap()).collect();
            pictures
                .last_mut()
                .unwrap()
                .pixels
                .extend(bytes.as_chunks::<4>().0);
        } else if message.starts_with("images ") {
            images = Some(message);
        } else {
            assert_eq!(message, "done", "the page reports an error");
        }
    }
    assert_eq!(images.as_deref(), Some("images 3 broken 0"));
    // Each exhibit, then the last with the light moved, then with the view turned.
    assert_eq!(pictures.len(), items.len() + 2);
    let [.., before, lit, turned] = &*pictures else {
        panic!("too few pictures");
    };
    assert_ne!(before.light, lit.light);
    assert_eq!(before.viewer, lit.viewer);
    assert_ne!(lit.viewer, turned.viewer);
    assert_eq!(lit.light, turned.light);

    for picture in &pictures {
        let Shown {
            item,
            light,
            viewer,
            up,
            pixels,
        } = picture;
        let scene = sphere(SIZE as u32, 1, *viewer, *up, *light).unwrap();
        let supply = SingleMaterial(&items[*item].model);
        let rendering = render(&scene, &supply, Options::default(), &|_, _| {}).unwrap();
        let expected = Bitmap::display(&rendering);
        let (mut compared, mut lit, mut most) = (0, 0, 0);
        for (at, (found, expected)) in pixels
            .iter()
            .zip(expected.bytes().as_chunks::<3>().0)
            .enumerate()
        {
            let place = |index: usize| (index as f64 + 0.5) / (SIZE as f64 / 2.0) - 1.0;
            let r = 1.12 * place(at % SIZE).hypot(place(at / SIZE));
            // One pixel about the edge is mixed with the ground.
            let pixel = 2.0 * 1.12 / SIZE as f64;
            if r > 1.0 + pixel {
                assert_eq!(*found, [0; 4], "{at}");
            }
            if r > 1.0 - pixel {
                continue;
            }
            assert_eq!(found[3], 255, "{at}");
            for c in 0..3 {
                most = most.max(found[c].abs_diff(expected[c]));
            }
            compared += 1;
            lit += usize::from(found[1] > 8);
        }
        println!(
            "exhibit {item}: {compared} pixels, {lit} of them lit, at most {most} steps apart"
        );
        // Of a dark material with the light from behind, a tenth.
        assert!(compared > 2000 && lit > 200, "{compared} {lit}");
        // Single precision moves a value across the edge of a step, but no further.
        assert!(most <= 1, "exhibit {item}: {most} steps");
    }
}
