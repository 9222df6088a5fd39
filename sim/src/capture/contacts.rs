//! Contacts of MuJoCo as pairs of bodies, with forces in world axes.

use kinetoscope_mujoco::Data;
use kinetoscope_scene::Contact;
use nalgebra::{Matrix3, Vector3};

/// Replaces `contacts` by all contacts with constraint rows, whose forces are solved. `owners` has the body-axis index
/// of each geom, `None` for the world. Contacts within the margin only have no constraint rows and are left out.
pub(super) fn capture(owners: &[Option<u32>], data: &Data, contacts: &mut Vec<Contact>) {
    contacts.clear();
    for (index, contact) in data.contact().iter().enumerate() {
        let owner = |geom: i32| usize::try_from(geom).ok().and_then(|geom| owners.get(geom)).copied();
        let (Some(first), Some(second)) = (owner(contact.geom1), owner(contact.geom2)) else { continue };
        if contact.efc_address < 0 {
            continue;
        }
        // The rows of `frame` are the normal, from the first geom to the second, and two tangents. The force in these
        // axes acts on the second geom.
        let [normal_force, tangent1, tangent2, ..] = data.contact_force(index);
        let world_from_contact = Matrix3::from_row_slice(&contact.frame).transpose();
        let force = world_from_contact * Vector3::new(normal_force, tangent1, tangent2);
        contacts.push(Contact {
            bodies: [first, second],
            point: contact.pos,
            normal: [contact.frame[0], contact.frame[1], contact.frame[2]],
            distance: contact.dist,
            force: force.into(),
            normal_force,
        });
    }
}
