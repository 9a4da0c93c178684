// Replaces doxygen's search on a server: finds the sections that have all words, in search/index.js.
function searchFor(query) { // eslint-disable-line no-unused-vars
  const words = query.toLowerCase().split(/\s+/).filter(word => word);
  const rank = (name, title, text) => { // 0 if a word is missing
    let sum = 0;
    for (const word of words) {
      const exact = title.toLowerCase().split(/[^\w]+/).includes(word);
      const found = (exact ? 20 : 0) + (title.toLowerCase().includes(word) ? 10 : 0) +
        (name.toLowerCase().includes(word) ? 5 : 0) + Math.min(10, text.toLowerCase().split(word).length - 1);
      if (!found) return 0;
      sum += found;
    }
    return / Reference$/.test(name) ? sum / 3 : sum; // of C++ and C: documents come first
  };
  const show = () => {
    const hits = window.searchIndex.map(entry => [rank(...entry.slice(1)), ...entry])
      .filter(hit => hit[0]).sort((one, other) => other[0] - one[0]);
    const list = document.createElement('ol');
    for (const [, url, name, title, text] of hits.slice(0, 50)) {
      const item = list.appendChild(document.createElement('li'));
      const link = item.appendChild(document.createElement('a'));
      link.href = url;
      link.textContent = title && title !== name ? `${name}: ${title}` : name;
      const at = Math.max(0, text.toLowerCase().indexOf(words[0]) - 80);
      item.append(document.createElement('br'), (at ? '... ' : '') + text.slice(at, at + 240));
    }
    document.getElementById('MSearchField').value = query;
    document.getElementById('searchresults').replaceChildren(`${hits.length} sections have "${query}".`, list);
  };
  const script = document.head.appendChild(document.createElement('script'));
  script.onload = show;
  script.src = 'search/index.js';
}
