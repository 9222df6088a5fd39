//! Images of the browser view.

use super::running::ServedSimulation;
use super::test_client::{ServerMessage, TestClient};
use crate::support::{colors, red};
use image::RgbImage;
use kinetoscope_testkit::wait::TIMEOUT;
use serde_json::json;
use std::time::Duration;

/// Returns the share of red pixels.
fn share(image: &RgbImage) -> f64 {
    red(image).0 as f64 / f64::from(image.width() * image.height())
}

fn shades(image: &RgbImage) -> usize {
    colors(image.pixels().map(|p| p.0))
}

/// Images have the requested size and show the scene; those of a camera sensor show its four channels.
#[test]
fn sizes_and_channels() {
    let running = ServedSimulation::start(2);
    let mut visitor = TestClient::connect(running.address);
    visitor.send(json!({"do": "environment", "env": 0}));
    for (width, height) in [(320, 180), (203, 121), (640, 360)] {
        visitor.send(json!({"do": "size", "width": width, "height": height}));
        let image = visitor.wait_image("stage", |_, image| image.dimensions() == (width, height));
        assert!(shades(&image) > 100, "{} colors", shades(&image));
        assert!((0.001..0.9).contains(&share(&image)), "the cube is seen: {}", share(&image));
    }
    visitor.send(json!({"do": "camera", "name": "eye"}));
    let image = visitor.wait_image("camera", |about, _| about["camera"] == "eye");
    // Four images of 64 x 48 in a grid: color, depth, mask and normals.
    assert_eq!(image.dimensions(), (128, 96));
    let parts = [[0, 0], [64, 0], [0, 48], [64, 48]];
    let parts = parts.map(|[x, y]| image::imageops::crop_imm(&image, x, y, 64, 48).to_image());
    assert!(parts.iter().all(|part| shades(part) > 20), "{:?} colors", parts.each_ref().map(shades));
    assert!(share(&parts[0]) > 0.02, "the cube is red");
    assert!(parts[0] != parts[1] && parts[2] != parts[3], "channels differ");
}

#[test]
fn view_commands() {
    let running = ServedSimulation::start(1);
    let mut visitor = TestClient::connect(running.address);
    visitor.send(json!({"do": "size", "width": 320, "height": 180}));
    // Paused, so that only the view changes.
    visitor.pause();
    let mut after = |commands: &[serde_json::Value]| {
        commands.iter().for_each(|command| visitor.send(command.clone()));
        settled(&mut visitor)
    };
    let home = after(&[json!({"do": "home"})]);
    let far = after(&[json!({"do": "zoom", "by": -6.0})]);
    assert!(share(&far) < 0.7 * share(&home), "from farther away everything is smaller: {}", share(&far));
    assert!(after(&[json!({"do": "home"})]) == home, "the same view of the same scene is the same image");
    let panned = after(&[json!({"do": "pan", "dx": -0.2, "dy": 0.0})]);
    // 0.2 heights of 180 pixels, at the target's distance; the cube is slightly nearer or farther.
    let moved = red(&home).1[0] - red(&panned).1[0];
    assert!((18.0..60.0).contains(&moved), "{moved} pixels");
    let turned = after(&[json!({"do": "home"}), json!({"do": "orbit", "dx": 0.3, "dy": 0.1})]);
    assert!(turned != home, "from another side it is another image");
}

/// Waits for the last image of the most recently requested view.
fn settled(visitor: &mut TestClient) -> RgbImage {
    let mut last = visitor.wait_image("stage", |_, _| true);
    // Commands and images take turns on one connection: a refusal follows the commands before it.
    visitor.send(json!({"do": "environment", "env": 999}));
    visitor.wait("the answer", |came| match came {
        ServerMessage::Image { about, image } if about["shows"] == "stage" => {
            last = image;
            None
        }
        ServerMessage::Refused(_) => Some(()),
        _ => None,
    });
    // An image rendered after that, if the view changed: at most one is still to come.
    let stream = visitor.socket.get_ref().try_clone().unwrap();
    stream.set_read_timeout(Some(Duration::from_millis(700))).unwrap();
    while let Some(came) = visitor.next_message() {
        if let ServerMessage::Image { about, image } = came
            && about["shows"] == "stage"
        {
            last = image;
        }
    }
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    last
}
