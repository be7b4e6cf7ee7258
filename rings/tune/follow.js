// Changes that come with every picture go past Vue, which would compare the whole page for each.
const follow_by = {
  html: (id, markup) => {
    getHtmlElement(id).innerHTML = markup;
  },
  background: (id, colours) => {
    getHtmlElement(id).style.background = colours;
  },
  value: (id, words) => {
    getHtmlElement(id).value = words;
    Vue.toRaw(mounted_app.elements)[id].props.value = words; // for when Vue draws it again
  },
  picture: (id, ...picture) => getElement(id).show(...picture),
};

// What is chosen anew meanwhile is gone from the page, and its changes with it.
window.follow = (changes) =>
  Promise.all(
    changes
      .filter(([id]) => getHtmlElement(id))
      .map(([id, what, ...words]) => follow_by[what](id, ...words)),
  ).then(() => true);
