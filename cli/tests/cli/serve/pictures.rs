//! What viewers see.

use crate::serve::running::Running;
use crate::serve::visitor::Visitor;
use image::RgbImage;
use serde_json::json;
use std::collections::BTreeSet;

/// Part of the pixels that are red: of the cube, nothing else is.
fn red(picture: &RgbImage) -> f64 {
    let red = picture.pixels().filter(|p| p[0] > 60 && f64::from(p[0]) > 2.5 * f64::from(p[1].max(p[2]))).count();
    red as f64 / f64::from(picture.width() * picture.height())
}

fn colors(picture: &RgbImage) -> usize {
    picture.pixels().map(|p| p.0).collect::<BTreeSet<_>>().len()
}

#[test]
fn pictures_come_in_the_size_that_was_asked_for_and_show_the_scene() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    for (width, height) in [(320, 180), (203, 121), (640, 360)] {
        visitor.ask(json!({"do": "size", "width": width, "height": height}));
        let picture = visitor.wait_picture("stage", |_, picture| picture.dimensions() == (width, height));
        assert!(colors(&picture) > 100, "{} colours", colors(&picture));
        let red = red(&picture);
        assert!((0.001..0.9).contains(&red), "the cube is seen: {red}");
    }
}

#[test]
fn the_hand_moves_the_view() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    visitor.ask(json!({"do": "size", "width": 320, "height": 180}));
    // Held, so that nothing but the view changes.
    visitor.ask(json!({"do": "pause"}));
    visitor.wait_state("paused", |state| state["paused"] == true);
    // As it looks from where everything is now.
    visitor.ask(json!({"do": "home"}));
    let home = settled(&mut visitor);
    let seen = red(&home);
    visitor.ask(json!({"do": "zoom", "by": -6.0}));
    let far = red(&settled(&mut visitor));
    assert!(far < 0.7 * seen, "{far} of {seen}: from farther away everything is smaller");
    visitor.ask(json!({"do": "home"}));
    assert!(settled(&mut visitor) == home, "the same view of the same scene is the same picture");
    // Half a picture to the left.
    let middle = |picture: &RgbImage| {
        let at =
            picture.enumerate_pixels().filter(|(.., p)| p[0] > 60 && u32::from(p[0]) > 2 * u32::from(p[1].max(p[2])));
        let (sum, n) = at.fold((0.0, 0.0), |(sum, n), (x, ..)| (sum + f64::from(x), n + 1.0));
        sum / n
    };
    visitor.ask(json!({"do": "pan", "dx": -0.2, "dy": 0.0}));
    let panned = settled(&mut visitor);
    // 0.2 heights of 180 pixels, as far as the middle of what is looked at; the cube is a little nearer or farther.
    let moved = middle(&home) - middle(&panned);
    assert!((18.0..60.0).contains(&moved), "{moved} pixels");
    visitor.ask(json!({"do": "home"}));
    visitor.ask(json!({"do": "orbit", "dx": 0.3, "dy": 0.1}));
    assert!(settled(&mut visitor) != home, "from another side it is another picture");
}

/// The picture after which no other comes while a state does: of the view that was asked for last.
fn settled(visitor: &mut Visitor) -> RgbImage {
    let mut last = visitor.wait_picture("stage", |_, _| true);
    // Commands and pictures take turns on one connection: what is refused after a command was read after it.
    visitor.ask(json!({"do": "environment", "env": 999}));
    visitor.wait("the answer", |came| match came {
        crate::serve::visitor::Came::Picture { about, picture } if about["shows"] == "stage" => {
            last = picture;
            None
        }
        crate::serve::visitor::Came::Refused(_) => Some(()),
        _ => None,
    });
    // One that was drawn after that, if the view changed: at most one is still to come.
    visitor.socket.get_ref().set_read_timeout(Some(std::time::Duration::from_millis(700))).unwrap();
    while let Some(picture) = visitor.next_or_silence() {
        last = picture;
    }
    visitor.socket.get_ref().set_read_timeout(Some(std::time::Duration::from_secs(60))).unwrap();
    last
}

#[test]
fn a_camera_shows_its_four_channels() {
    let running = Running::start(2);
    let mut visitor = Visitor::enter(&running);
    visitor.ask(json!({"do": "camera", "name": "eye"}));
    let picture = visitor.wait_picture("camera", |about, _| about["camera"] == "eye");
    // Four of 64 x 48 in a grid.
    assert_eq!(picture.dimensions(), (128, 96));
    for (channel, [x, y]) in [("color", [0, 0]), ("depth", [64, 0]), ("mask", [0, 48]), ("normals", [64, 48])] {
        let part = image::imageops::crop_imm(&picture, x, y, 64, 48).to_image();
        assert!(colors(&part) > 20, "{channel}: {} colours", colors(&part));
    }
    let part = |x, y| image::imageops::crop_imm(&picture, x, y, 64, 48).to_image();
    assert!(red(&part(0, 0)) > 0.02, "the cube is red");
    assert!(part(0, 0) != part(64, 0) && part(0, 48) != part(64, 48), "channels differ");
    visitor.ask(json!({"do": "camera", "name": null}));
}
