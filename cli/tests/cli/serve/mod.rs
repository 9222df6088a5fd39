//! The browser view without a browser: access, images, commands, several viewers, and hostile clients.

mod access;
mod hostile;
mod images;
pub(crate) mod running;
mod several;
mod steering;
pub(crate) mod test_client;
